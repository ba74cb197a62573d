#pragma once

// Loops shared by all instruction sets. Each particle_kernel_*.cpp defines a type Pack in its own
// unnamed namespace and includes this file, so that no two translation units share a symbol that
// was compiled with different instruction sets. For the same reason nothing of the standard
// library's templates may be used here.

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "estimators/particle_kernel.h"

namespace holdfast {

/// log(erfc(z) / 2) for z of 3 and more, by the continued fraction of erfc; also where erfc is
/// zero.
double log_half_erfc(double z);
/// log of sum of weight_i erfc(z_i), where the sum itself underflows.
double log_glint_tail(const double weight[2], const double z[2]);

namespace {

template <class Pack>
struct Kernel {
  using V = typename Pack::V;
  static constexpr std::size_t kLanes = Pack::kLanes;

  static void fill_normals(const NormalAddress& address, double* const normals[4],
                           std::size_t padded) {
    for (std::size_t i = 0; i < padded; i += kLanes) {
      for (int pair = 0; pair < 2; ++pair) {
        typename Pack::I words[4];
        // Blocks 2 i and 2 i + 1 of the step hold the particle's four normals.
        words[0] = Pack::counters(2 * i + static_cast<std::size_t>(pair), 2);
        words[1] = Pack::set_integer(0);
        words[2] = Pack::set_integer(address.step);
        words[3] = Pack::set_integer(address.run);
        philox(address.key, words);
        const V radius =
            Pack::sqrt(Pack::mul(Pack::set(-2.0), Pack::log(Pack::unit(words[0], words[1]))));
        V cosine, sine;
        Pack::circle(Pack::unit(words[2], words[3]), cosine, sine);
        Pack::store(normals[2 * pair] + i, Pack::mul(radius, cosine));
        Pack::store(normals[2 * pair + 1] + i, Pack::mul(radius, sine));
      }
    }
  }

  // Philox4x32-10 (Salmon et al. 2011), one counter per lane. Each lane is 64 bits wide and only
  // its lower half counts.
  static void philox(std::uint64_t key, typename Pack::I words[4]) {
    auto key_0 = static_cast<std::uint32_t>(key);
    auto key_1 = static_cast<std::uint32_t>(key >> 32);
    for (int round = 0; round < 10; ++round) {
      const auto product_0 = Pack::mul_low32(words[0], 0xD2511F53U);
      const auto product_1 = Pack::mul_low32(words[2], 0xCD9E8D57U);
      const auto high_0 = Pack::shift_right_32(product_0);
      const auto high_1 = Pack::shift_right_32(product_1);
      words[0] = Pack::bit_xor(Pack::bit_xor(high_1, words[1]), Pack::set_integer(key_0));
      words[2] = Pack::bit_xor(Pack::bit_xor(high_0, words[3]), Pack::set_integer(key_1));
      words[1] = product_1;
      words[3] = product_0;
      key_0 += 0x9E3779B9U;
      key_1 += 0xBB67AE85U;
    }
  }

  static void propagate(const MotionConstants& motion, const double* const normals[4],
                        double* const state[4], std::size_t padded) {
    const V step = Pack::set(motion.step_s), position_noise = Pack::set(motion.noise_position);
    const V cross = Pack::set(motion.noise_cross),
            velocity_noise = Pack::set(motion.noise_velocity);
    for (int axis = 0; axis < 4; axis += 2) {
      for (std::size_t i = 0; i < padded; i += kLanes) {
        const V n_0 = Pack::load(normals[axis] + i), n_1 = Pack::load(normals[axis + 1] + i);
        const V velocity = Pack::load(state[axis + 1] + i);
        const V position = Pack::fma(step, velocity, Pack::load(state[axis] + i));
        Pack::store(state[axis] + i, Pack::fma(position_noise, n_0, position));
        Pack::store(state[axis + 1] + i,
                    Pack::fma(cross, n_0, Pack::fma(velocity_noise, n_1, velocity)));
      }
    }
  }

  static V squared_distance(const LikelihoodFactor& factor, V x, V y) {
    const V dx = Pack::sub(x, Pack::set(factor.sensor_x_m));
    const V dy = Pack::sub(y, Pack::set(factor.sensor_y_m));
    return Pack::fma(dx, dx, Pack::mul(dy, dy));
  }

  // Values of up to kChunk factors, for one vector of particles. More would overlap no better, and
  // take more of the first cache.
  static constexpr std::size_t kChunk = 8;
  struct Stage {
    V energy[kChunk];
    V z[2][kChunk];  // argument of erfc, per noise component
    V erfc[2][kChunk];
  };

  // One function at a time over all factors: a chain of log, exp and erfc for one factor is bound
  // by its latency, while calls of one function overlap (AVX2: 65 instead of 96 us).
  static void evaluate(const DetectionLaw& law, const LikelihoodFactor* factors, std::size_t count,
                       V x, V y, bool in_tails, Stage& stage) {
    for (std::size_t f = 0; f < count; ++f) {
      // Bounded so that neither the logarithm nor the product with the gain meets 0 or infinity.
      const V d2 = Pack::max(squared_distance(factors[f], x, y), Pack::set(1e-300));
      stage.energy[f] = Pack::log(Pack::min(d2, Pack::set(1e300)));
    }
    const V energy_max = Pack::set(in_tails ? kEnergyHuge : law.energy_max);
    for (std::size_t f = 0; f < count; ++f) {
      const V exponent = Pack::mul(Pack::set(law.exponent), stage.energy[f]);
      const V power = Pack::exp(Pack::min(exponent, Pack::set(700.0)));
      stage.energy[f] = Pack::min(Pack::mul(Pack::set(law.gain), power), energy_max);
    }
    for (int i = 0; i < 2; ++i) {
      for (std::size_t f = 0; f < count; ++f) {
        const V z =
            Pack::negative_fma(stage.energy[f], Pack::set(law.scale[i]), Pack::set(law.offset[i]));
        if (in_tails) stage.z[i][f] = z;
        stage.erfc[i][f] = Pack::erfc(in_tails ? Pack::abs(z) : z);
      }
    }
  }

  struct Tails {
    V q, complement;
    V z[2];
  };

  // q and 1 - q, each with its own relative accuracy: the smaller half from erfc(|z|).
  static Tails both_tails(const DetectionLaw& law, const Stage& stage, std::size_t f) {
    Tails tails;
    tails.q = tails.complement = Pack::set(0.0);
    for (int i = 0; i < 2; ++i) {
      const V z = stage.z[i][f], small = stage.erfc[i][f];
      const V large = Pack::sub(Pack::set(2.0), small);
      const V weight = Pack::set(law.weight[i]);
      tails.q = Pack::fma(weight, Pack::select_negative(z, large, small), tails.q);
      tails.complement =
          Pack::fma(weight, Pack::select_negative(z, small, large), tails.complement);
      tails.z[i] = z;
    }
    return tails;
  }

  static V log_tail(const DetectionLaw& law, V probability, const V z[2], double sign) {
    alignas(64) double values[kLanes], logs[kLanes], z_0[kLanes], z_1[kLanes];
    const V bounded = Pack::max(probability, Pack::set(kTailMin));
    const V logarithm = Pack::log(bounded);
    Pack::store(values, probability);
    bool is_plain = true;
    for (std::size_t lane = 0; lane < kLanes; ++lane)
      is_plain = is_plain && values[lane] > kTailMin;
    if (is_plain) return logarithm;
    Pack::store(logs, logarithm);
    Pack::store(z_0, z[0]);
    Pack::store(z_1, z[1]);
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      if (values[lane] > kTailMin) continue;
      const double arguments[2] = {sign * z_0[lane], sign * z_1[lane]};
      logs[lane] = log_glint_tail(law.weight, arguments);
    }
    return Pack::load(logs);
  }

  static V two_log_factor(const DetectionLaw& law, const LikelihoodFactor& factor,
                          const Tails& tails) {
    const bool has_hit = factor.log_at_hit > -kLogHuge, has_miss = factor.log_at_miss > -kLogHuge;
    V hit = Pack::set(-kLogHuge), miss = hit;
    if (has_hit)
      hit = Pack::add(Pack::set(factor.log_at_hit), log_tail(law, tails.q, tails.z, 1.0));
    if (!has_miss) return hit;
    miss = Pack::add(Pack::set(factor.log_at_miss), log_tail(law, tails.complement, tails.z, -1.0));
    if (!has_hit) return miss;
    const V larger = Pack::max(Pack::max(hit, miss), Pack::set(-kLogHuge));
    const V difference = Pack::max(Pack::sub(Pack::min(hit, miss), larger), Pack::set(-700.0));
    return Pack::add(larger, Pack::log(Pack::add(Pack::set(1.0), Pack::exp(difference))));
  }

  static V table_detection(const DetectionTableView& table, V d2) {
    const V bounded = Pack::min(Pack::max(d2, Pack::set(table.low_m2)), Pack::set(table.high_m2));
    V c_0, c_1, c_2, c_3;
    const V f = Pack::table_row(table, bounded, c_0, c_1, c_2, c_3);
    return Pack::fma(Pack::fma(Pack::fma(c_3, f, c_2), f, c_1), f, c_0);
  }

  static V linear_factor(const LikelihoodFactor& factor, V q) {
    return Pack::fma(Pack::set(factor.at_hit - factor.at_miss), q, Pack::set(factor.at_miss));
  }

  static V table_product(const LikelihoodProblem& problem, V x, V y, double* row,
                         std::size_t padded) {
    V product = Pack::set(1.0);
    for (std::size_t f = 0; f < problem.num_linear; ++f) {
      const LikelihoodFactor& factor = problem.factors[f];
      const V q = table_detection(*problem.table, squared_distance(factor, x, y));
      product = Pack::mul(product, linear_factor(factor, q));
      if (row != nullptr) Pack::store(row + f * padded, q);
    }
    return product;
  }

  static V exact_product(const LikelihoodProblem& problem, V x, V y, double* row,
                         std::size_t padded) {
    V product = Pack::set(1.0);
    const V weight_0 = Pack::set(problem.law->weight[0]),
            weight_1 = Pack::set(problem.law->weight[1]);
    Stage stage;
    for (std::size_t first = 0; first < problem.num_linear; first += kChunk) {
      const LikelihoodFactor* factors = problem.factors + first;
      const std::size_t count = smaller(kChunk, problem.num_linear - first);
      evaluate(*problem.law, factors, count, x, y, false, stage);
      for (std::size_t f = 0; f < count; ++f) {
        const V q = Pack::fma(weight_0, stage.erfc[0][f], Pack::mul(weight_1, stage.erfc[1][f]));
        product = Pack::mul(product, linear_factor(factors[f], q));
        if (row != nullptr) Pack::store(row + (first + f) * padded, q);
      }
    }
    return product;
  }

  // Factors from num_linear on.
  static V log_factors(const LikelihoodProblem& problem, V x, V y, double* row,
                       std::size_t padded) {
    const std::size_t num_one_log = problem.num_linear + problem.num_log;
    const std::size_t num_factors = num_one_log + problem.num_two_log;
    V log_sum = Pack::set(0.0);
    Stage stage;
    for (std::size_t first = problem.num_linear; first < num_factors; first += kChunk) {
      const std::size_t count = smaller(kChunk, num_factors - first);
      evaluate(*problem.law, problem.factors + first, count, x, y, true, stage);
      for (std::size_t f = 0; f < count; ++f) {
        const LikelihoodFactor& factor = problem.factors[first + f];
        const Tails tails = both_tails(*problem.law, stage, f);
        V logarithm;
        if (first + f < num_one_log) {
          logarithm = Pack::log(Pack::fma(Pack::set(factor.at_hit), tails.q,
                                          Pack::mul(Pack::set(factor.at_miss), tails.complement)));
        } else {
          logarithm = two_log_factor(*problem.law, factor, tails);
        }
        log_sum = Pack::add(log_sum, logarithm);
        if (row != nullptr) Pack::store(row + (first + f) * padded, tails.q);
      }
    }
    return log_sum;
  }

  static void weigh(const LikelihoodProblem& problem, const double* x, const double* y, double* out,
                    std::size_t padded) {
    for (std::size_t i = 0; i < padded; i += kLanes) {
      const V px = Pack::load(x + i), py = Pack::load(y + i);
      double* row = problem.q == nullptr ? nullptr : problem.q + i;
      const V product = problem.table != nullptr ? table_product(problem, px, py, row, padded)
                                                 : exact_product(problem, px, py, row, padded);
      if (!problem.as_log) {
        Pack::store(out + i, product);
      } else {
        Pack::store(out + i,
                    Pack::add(Pack::log(product), log_factors(problem, px, py, row, padded)));
      }
    }
  }

  static constexpr std::size_t smaller(std::size_t a, std::size_t b) { return a < b ? a : b; }

  static void exponential(const double* log_weights, double log_max, double* weights,
                          std::size_t padded) {
    for (std::size_t i = 0; i < padded; i += kLanes) {
      const V difference = Pack::sub(Pack::load(log_weights + i), Pack::set(log_max));
      const V bounded = Pack::max(difference, Pack::set(-745.0));
      // Below the smallest exponent the weight is zero, not exp(-745).
      Pack::store(weights + i, Pack::select_negative(Pack::add(difference, Pack::set(700.0)),
                                                     Pack::set(0.0), Pack::exp(bounded)));
    }
  }

  static double sum(const double* values, std::size_t padded) {
    V total = Pack::set(0.0);
    for (std::size_t i = 0; i < padded; i += kLanes)
      total = Pack::add(total, Pack::load(values + i));
    return Pack::reduce(total);
  }

  static double sum_of_squares(const double* values, std::size_t padded) {
    V total = Pack::set(0.0);
    for (std::size_t i = 0; i < padded; i += kLanes) {
      const V value = Pack::load(values + i);
      total = Pack::fma(value, value, total);
    }
    return Pack::reduce(total);
  }

  static void scale(double factor, double* values, std::size_t padded) {
    for (std::size_t i = 0; i < padded; i += kLanes) {
      Pack::store(values + i, Pack::mul(Pack::set(factor), Pack::load(values + i)));
    }
  }

  static void moments(const double* const state[4], const double* weights, std::size_t padded,
                      Moments& moments) {
    V sums[4] = {Pack::set(0.0), Pack::set(0.0), Pack::set(0.0), Pack::set(0.0)};
    for (std::size_t i = 0; i < padded; i += kLanes) {
      const V weight = Pack::load(weights + i);
      for (int c = 0; c < 4; ++c) sums[c] = Pack::fma(weight, Pack::load(state[c] + i), sums[c]);
    }
    for (int c = 0; c < 4; ++c) moments.mean[c] = Pack::reduce(sums[c]);
    V products[10];
    for (V& product : products) product = Pack::set(0.0);
    for (std::size_t i = 0; i < padded; i += kLanes) {
      const V weight = Pack::load(weights + i);
      V error[4];
      for (int c = 0; c < 4; ++c) {
        error[c] = Pack::sub(Pack::load(state[c] + i), Pack::set(moments.mean[c]));
      }
      for (int row = 0, entry = 0; row < 4; ++row) {
        const V weighted = Pack::mul(weight, error[row]);
        for (int column = 0; column <= row; ++column, ++entry) {
          products[entry] = Pack::fma(weighted, error[column], products[entry]);
        }
      }
    }
    for (int row = 0, entry = 0; row < 4; ++row) {
      for (int column = 0; column <= row; ++column, ++entry) {
        moments.covariance[row][column] = moments.covariance[column][row] =
            Pack::reduce(products[entry]);
      }
    }
  }

  static double authentic(const AuthenticRatio& ratio, const double* q, const double* weights,
                          std::size_t padded) {
    V total = Pack::set(0.0);
    const V miss = Pack::set(ratio.miss), slope = Pack::set(ratio.hit - ratio.miss);
    const V all_miss = Pack::set(ratio.all_miss),
            all_slope = Pack::set(ratio.all_hit - ratio.all_miss);
    for (std::size_t i = 0; i < padded; i += kLanes) {
      const V probability = Pack::load(q + i);
      const V numerator = Pack::fma(slope, probability, miss);
      const V denominator =
          Pack::max(Pack::fma(all_slope, probability, all_miss), Pack::set(1e-300));
      total = Pack::fma(Pack::load(weights + i), Pack::div(numerator, denominator), total);
    }
    return Pack::reduce(total);
  }

  static constexpr double kTailMin = 1e-290;    // below, erfc has lost digits or is zero
  static constexpr double kEnergyHuge = 1e140;  // its square, scaled, stays finite
  static constexpr double kLogHuge = 1e300;     // stands for an infinite logarithm
};

template <class Pack>
constexpr ParticleKernel make_kernel(const char* name) {
  using K = Kernel<Pack>;
  return {name,   K::fill_normals,   K::propagate, K::weigh,   K::exponential,
          K::sum, K::sum_of_squares, K::scale,     K::moments, K::authentic};
}

}  // namespace
}  // namespace holdfast
