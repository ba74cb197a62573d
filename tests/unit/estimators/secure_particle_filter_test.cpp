#include "estimators/secure_particle_filter.h"

#include <cmath>
#include <limits>
#include <memory>

#include "common/errors.h"
#include "estimators/resampling.h"
#include "tests/unit/estimators/golden_binary_pf.h"

using namespace holdfast;
using namespace holdfast::testing;
using Options = SecureParticleFilterOptions;

namespace {

const Eigen::VectorXd kNoInput;

Options options_of(int particles) {
  Options options;
  options.particles = particles;
  return options;
}

// Readings of a target that moves along the spec's straight path, one lie in five.
MeasurementSet readings_of(const BinaryTargetModel& model, std::int64_t step) {
  const RandomStream stream(77, 0, "test/scenario");
  const auto k = static_cast<std::uint32_t>(step);
  MeasurementSet set;
  set.clear(step, step * 1000000);
  const double time_s = model.step_s * static_cast<double>(step);
  const BinaryTargetModel::State truth(15.0 + 0.4 * time_s, 0.4, 20.0 + 0.3 * time_s, 0.3);
  for (std::size_t s = 0; s < model.num_sensors(); ++s) {
    bool bit = model.energy(truth, s) > model.threshold;
    if (stream.uniform(k, s) < 0.2) bit = !bit;
    const double y =
        model.has_radio_channel
            ? model.radio_gain * bit + model.radio_noise_std * stream.normal(k, 1000 + s)
            : static_cast<double>(bit);
    add_packet(set, static_cast<int>(s), y, 100 * step + static_cast<std::int64_t>(s));
  }
  return set;
}

// Algorithm 1 written down as the paper prints it, with the streams of the filter: no affine form,
// no logarithm, no kernel.
class DirectFilter {
 public:
  DirectFilter(const BinaryTargetModel& model, const BinaryTargetModel::Attack& attack, int size)
      : model_(model), attack_(attack), draws_(5, 2, "pf"), resampling_(5, 2, "pf/resampling") {
    for (int i = 0; i < size; ++i) {
      const auto n = normals(0, i);
      const auto& prior = model.prior;
      const double speed = prior.speed_mean_mps + prior.speed_std_mps * n[2];
      const double heading = prior.heading_mean_rad + prior.heading_std_rad * n[3];
      particles_.emplace_back(
          prior.position_mean_m[0] + prior.position_std_m * n[0], speed * std::cos(heading),
          prior.position_mean_m[1] + prior.position_std_m * n[1], speed * std::sin(heading));
    }
  }

  Eigen::Vector4d step(std::int64_t step, const MeasurementSet& set, Eigen::Matrix4d& covariance) {
    std::vector<double> weights;
    double sum = 0.0;
    for (std::size_t i = 0; i < particles_.size(); ++i) {
      particles_[i] = model_.propagate(particles_[i], normals(step, static_cast<int>(i)));
      double weight = 1.0;
      for (const Packet& packet : set.packets) {
        weight *= density(static_cast<std::size_t>(packet.source), set.values_of(packet)[0],
                          particles_[i]);
      }
      weights.push_back(weight);
      sum += weight;
    }
    Eigen::Vector4d mean = Eigen::Vector4d::Zero();
    for (std::size_t i = 0; i < weights.size(); ++i) mean += (weights[i] /= sum) * particles_[i];
    covariance.setZero();
    for (std::size_t i = 0; i < weights.size(); ++i) {
      covariance += weights[i] * (particles_[i] - mean) * (particles_[i] - mean).transpose();
    }
    std::vector<std::int32_t> ancestors(weights.size());
    systematic_ancestors(weights, resampling_.uniform(static_cast<std::uint32_t>(step), 0),
                         ancestors);
    const auto before = particles_;
    for (std::size_t i = 0; i < ancestors.size(); ++i) {
      particles_[i] = before[static_cast<std::size_t>(ancestors[i])];
    }
    return mean;
  }

 private:
  Eigen::Vector4d normals(std::int64_t step, int i) const {
    Eigen::Vector4d n;
    for (int c = 0; c < 4; ++c) {
      n[c] = draws_.normal(static_cast<std::uint32_t>(step), static_cast<std::uint64_t>(4 * i + c));
    }
    return n;
  }
  double density(std::size_t s, double y, const Eigen::Vector4d& x) const {
    const double phi = attack_.dos[s], varphi = attack_.deception[s], alpha = attack_.flip[s];
    const double lie = (attack_.deception_high - model_.threshold) /
                       (attack_.deception_high - attack_.deception_low);
    const double read =
        (1 - phi) * (varphi * lie +
                     (1 - varphi) * model_.glint_survival(model_.threshold - model_.energy(x, s)));
    const double one = (1 - alpha) * read + alpha * (1 - read);
    const auto normal = [&](double mean) {
      return std::exp(-0.5 * std::pow((y - mean) / model_.radio_noise_std, 2));
    };
    return one * normal(model_.radio_gain) + (1 - one) * normal(0.0);
  }

  BinaryTargetModel model_;
  BinaryTargetModel::Attack attack_;
  RandomStream draws_, resampling_;
  std::vector<Eigen::Vector4d> particles_;
};

}  // namespace

TEST_CASE("the filter equals Algorithm 1 written down directly") {
  const BinaryTargetModel model = grid_model(true);
  for (const ParticleKernel* kernel : particle_kernels()) {
    INFO(kernel->name);
    Options options = options_of(203);  // not a multiple of any vector length
    options.kernel = kernel->name;
    SecureParticleFilter filter(model, table_attack(), options, 5, 2, "pf");
    DirectFilter direct(model, table_attack(), 203);
    double worst = 0.0;
    for (std::int64_t k = 1; k <= 30; ++k) {
      const MeasurementSet set = readings_of(model, k);
      Eigen::Matrix4d covariance;
      const Eigen::Vector4d mean = direct.step(k, set, covariance);
      const Estimate& estimate = filter.step(k, set, kNoInput);
      REQUIRE(estimate.outcome == StepOutcome::kOk);
      for (int row = 0; row < 4; ++row) {
        worst = std::max(worst, golden_error(estimate.mean[row], mean[row]));
        for (int column = 0; column < 4; ++column) {
          worst = std::max(worst,
                           golden_error(estimate.covariance(row, column), covariance(row, column)));
        }
      }
    }
    // Rounding grows along the path by the sum over 30 steps; a wrong ancestor would cost 1e-3.
    CHECK(worst < 1e-11);
  }
}

TEST_CASE("without packets the mean moves by F, and every particle counts the same") {
  BinaryTargetModel model = grid_model(true);
  model.process_noise_intensity = 0.0;
  SecureParticleFilter filter(model, table_attack(), options_of(500), 1, 0, "pf");
  MeasurementSet empty;
  empty.clear(1, 20);
  const Eigen::Vector4d first = filter.step(1, empty, kNoInput).mean;
  Eigen::Matrix4d F = Eigen::Matrix4d::Identity();
  F(0, 1) = F(2, 3) = model.step_s;
  for (std::int64_t k = 2; k <= 20; ++k) {
    const Estimate& estimate = filter.step(k, empty, kNoInput);
    CHECK(estimate.outcome == StepOutcome::kNoPackets);
    CHECK(estimate.packet_probability.empty());
  }
  Eigen::Vector4d wanted = first;
  for (int k = 2; k <= 20; ++k) wanted = F * wanted;
  const Estimate& last = filter.step(21, empty, kNoInput);
  CHECK((last.mean - F * wanted).norm() < 1e-12 * wanted.norm());
  CHECK(last.covariance.isApprox(last.covariance.transpose(), 0.0));
}

TEST_CASE("the prior has the model's moments") {
  BinaryTargetModel model = grid_model(true);
  const int size = 100000;
  const SecureParticleFilter filter(model, table_attack(), options_of(size), 3, 0, "pf");
  double mean[2] = {}, variance = 0.0, speed = 0.0, heading = 0.0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(size); ++i) {
    const auto& c = filter.particles().component;
    mean[0] += c[0][i] / size;
    mean[1] += c[2][i] / size;
    variance += std::pow(c[0][i] - 15.0, 2) / size;
    speed += (c[1][i] * c[1][i] + c[3][i] * c[3][i]) / size;
    heading += std::atan2(c[3][i], c[1][i]) / size;
  }
  const double se = 1.0 / std::sqrt(size);
  CHECK(std::abs(mean[0] - 15.0) < 4.5 * 10.0 * se);
  CHECK(std::abs(mean[1] - 20.0) < 4.5 * 10.0 * se);
  CHECK(std::abs(variance - 100.0) < 4.5 * 100.0 * std::sqrt(2.0) * se);
  // E speed^2 = 0.5^2 + 0.25^2; its standard deviation is 0.27.
  CHECK(std::abs(speed - 0.3125) < 4.5 * 0.27 * se);
  CHECK(std::abs(heading - std::atan2(3.0, 4.0)) < 0.15);  // negative speeds point backwards
}

TEST_CASE("a missing packet is a missing factor; refused ones are left out and counted") {
  const BinaryTargetModel model = grid_model(false);
  SecureParticleFilter partial(model, table_attack(), options_of(300), 1, 0, "pf");
  SecureParticleFilter dirty(model, table_attack(), options_of(300), 1, 0, "pf");
  for (std::int64_t k = 1; k <= 5; ++k) {
    const MeasurementSet all = readings_of(model, k);
    MeasurementSet some, bad;
    for (int s = 0; s < 16; ++s) {
      const double value = all.values[static_cast<std::size_t>(s)];
      if (s % 3 == 0) {
        add_packet(bad, s, std::numeric_limits<double>::quiet_NaN());
        continue;
      }
      add_packet(some, s, value);
      add_packet(bad, s, value);
    }
    add_packet(bad, 99, 1.0);
    const Estimate& a = partial.step(k, some, kNoInput);
    const Estimate& b = dirty.step(k, bad, kNoInput);
    CHECK(a.outcome == StepOutcome::kOk);
    CHECK(b.outcome == StepOutcome::kRefusedInput);
    CHECK(a.mean == b.mean);
    CHECK(a.covariance == b.covariance);
    CHECK(b.packet_probability[0] == 0.0);
  }
  CHECK(dirty.refused_packets() == 5 * 7);
  MeasurementSet only_bad;
  add_packet(only_bad, 3, std::numeric_limits<double>::infinity());
  CHECK(dirty.step(6, only_bad, kNoInput).outcome == StepOutcome::kRefusedInput);
}

TEST_CASE("equal seed, run and name give equal bits; any other gives another estimate") {
  const BinaryTargetModel model = grid_model(true);
  for (const ParticleKernel* kernel : particle_kernels()) {
    for (const auto proposal : {Options::Proposal::kBootstrap, Options::Proposal::kAuxiliary}) {
      Options options = options_of(128);
      options.kernel = kernel->name;
      options.proposal = proposal;
      SecureParticleFilter a(model, table_attack(), options, 9, 4, "pf"),
          b(model, table_attack(), options, 9, 4, "pf");
      SecureParticleFilter run(model, table_attack(), options, 9, 5, "pf"),
          name(model, table_attack(), options, 9, 4, "qf");
      for (std::int64_t k = 1; k <= 10; ++k) {
        const MeasurementSet set = readings_of(model, k);
        const Estimate& mine = a.step(k, set, kNoInput);
        const Estimate& same = b.step(k, set, kNoInput);
        REQUIRE(mine.mean == same.mean);
        REQUIRE(mine.covariance == same.covariance);
        REQUIRE(mine.packet_probability == same.packet_probability);
        CHECK(mine.mean != run.step(k, set, kNoInput).mean);
        CHECK(mine.mean != name.step(k, set, kNoInput).mean);
      }
    }
  }
}

TEST_CASE("an impossible reading is an outcome and keeps the weights") {
  const BinaryTargetModel model = grid_model(false);
  BinaryTargetModel::Attack dead = table_attack();
  dead.dos.assign(16, 1.0);  // every bit must be 0
  dead.flip.assign(16, 0.0);
  for (const auto proposal : {Options::Proposal::kBootstrap, Options::Proposal::kAuxiliary}) {
    Options options = options_of(100);
    options.proposal = proposal;
    SecureParticleFilter filter(model, dead, options, 1, 0, "pf");
    SecureParticleFilter idle(model, dead, options, 1, 0, "pf");
    MeasurementSet one, none;
    add_packet(one, 0, 1.0);
    const Estimate& estimate = filter.step(1, one, kNoInput);
    CHECK(estimate.outcome == StepOutcome::kDegenerateWeights);
    CHECK(estimate.mean == idle.step(1, none, kNoInput).mean);
    CHECK(filter.step(2, none, kNoInput).outcome == StepOutcome::kNoPackets);
  }
}

TEST_CASE("a filter that neglects attacks stays finite over readings that contradict it") {
  for (const bool has_radio : {false, true}) {
    const BinaryTargetModel model = grid_model(has_radio);
    SecureParticleFilter filter(model, {}, options_of(400), 1, 0, "pf");
    for (std::int64_t k = 1; k <= 60; ++k) {
      MeasurementSet set = readings_of(model, k);
      if (has_radio && k % 10 == 0) set.values[3] = 50.0;
      const Estimate& estimate = filter.step(k, set, kNoInput);
      REQUIRE(estimate.outcome == StepOutcome::kOk);
      REQUIRE(estimate.mean.allFinite());
      REQUIRE(estimate.covariance.allFinite());
      for (const double probability : estimate.packet_probability) {
        REQUIRE(probability == Approx(1.0).epsilon(1e-9));  // it believes in no attack
      }
    }
  }
}

TEST_CASE("weights carried over steps equal the product of the likelihoods") {
  BinaryTargetModel model = grid_model(true);
  Options never = options_of(256);
  never.resample_below = 0.0;
  SecureParticleFilter filter(model, table_attack(), never, 1, 0, "pf");
  BinaryLikelihood likelihood(model, table_attack(), DuplicateRule::kAverage, false,
                              *particle_kernels().front());
  std::vector<double> logs(256, 0.0);
  for (std::int64_t k = 1; k <= 4; ++k) {
    const MeasurementSet set = readings_of(model, k);
    filter.step(k, set, kNoInput);
    likelihood.set_measurements(set);
    AlignedArray out(256);
    likelihood.log_likelihood(filter.particles(), out.data(), nullptr);
    double sum = 0.0;
    for (std::size_t i = 0; i < 256; ++i) sum += std::exp(logs[i] += out[i]);
    for (std::size_t i = 0; i < 256; ++i) {
      REQUIRE(filter.weights()[i] == Approx(std::exp(logs[i]) / sum).epsilon(1e-11));
    }
  }
}

TEST_CASE("every choice of scheme, proposal and trigger has the same posterior mean") {
  BinaryTargetModel model = grid_model(true);
  const int num_runs = 100, size = 300;
  const std::int64_t num_steps = 8;
  const auto average = [&](const Options& options, const BinaryTargetModel::Attack& assumed,
                           Eigen::Vector2d& error) {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero(), squares = Eigen::Vector2d::Zero();
    for (std::uint32_t run = 0; run < num_runs; ++run) {
      SecureParticleFilter filter(model, assumed, options, 31, run, "pf");
      Eigen::Vector2d value;
      for (std::int64_t k = 1; k <= num_steps; ++k) {
        const Estimate& estimate = filter.step(k, readings_of(model, k), kNoInput);
        value = {estimate.mean[0], estimate.mean[2]};
      }
      sum += value;
      squares += value.cwiseProduct(value);
    }
    const Eigen::Vector2d mean = sum / num_runs;
    error = ((squares / num_runs - mean.cwiseProduct(mean)) / num_runs).cwiseSqrt();
    return mean;
  };
  Eigen::Vector2d reference_error, error;
  const Options base = options_of(size);
  // A filter with M particles has a bias of order 1/M; the reference has 5 M and shares it least.
  const Eigen::Vector2d reference = average(options_of(5 * size), table_attack(), reference_error);
  std::vector<Options> variants(6, base);
  variants[1].resampling = Options::Resampling::kStratified;
  variants[2].resampling = Options::Resampling::kMultinomial;
  variants[3].resample_below = 0.5;
  variants[4].proposal = Options::Proposal::kAuxiliary;
  variants[5].proposal = Options::Proposal::kAuxiliary;
  variants[5].resample_below = 0.5;
  for (std::size_t v = 0; v < variants.size(); ++v) {
    const Eigen::Vector2d mean = average(variants[v], table_attack(), error);
    for (int c = 0; c < 2; ++c) {
      INFO("variant " << v << ": " << mean[c] << " against " << reference[c]);
      CHECK(std::abs(mean[c] - reference[c]) < 4.5 * std::hypot(error[c], reference_error[c]));
    }
  }
  const Eigen::Vector2d neglecting = average(base, {}, error);
  CHECK((neglecting - reference).norm() > 4.5 * (error.norm() + reference_error.norm()));
}

TEST_CASE("options that cannot work are refused with a reason") {
  const BinaryTargetModel model = grid_model(true);
  Options options = options_of(10);
  options.kernel = "none such";
  CHECK_THROWS_AS(SecureParticleFilter(model, {}, options, 1, 0, "pf"), UsageError);
  BinaryTargetModel::Attack short_attack;
  short_attack.dos = {0.1, 0.2};
  CHECK_THROWS_AS(SecureParticleFilter(model, short_attack, options_of(10), 1, 0, "pf"),
                  UsageError);

  const auto read = [](const std::string& text, Options& out) {
    auto document = ConfigurationDocument::from_text(text, "test.yaml");
    out.read(document.root());
    document.finish();
  };
  Options got;
  read(
      "{particles: 600, resampling: multinomial, resample_below: 0.5, proposal: auxiliary, "
      "likelihood: table, duplicates: last, packet_posteriors: false, kernel: portable}",
      got);
  CHECK(got.particles == 600);
  CHECK(got.resampling == Options::Resampling::kMultinomial);
  CHECK(got.resample_below == 0.5);
  CHECK(got.proposal == Options::Proposal::kAuxiliary);
  CHECK(got.likelihood == Options::Likelihood::kTable);
  CHECK(got.duplicates == DuplicateRule::kLast);
  CHECK_FALSE(got.packet_posteriors);
  CHECK(got.kernel == "portable");
  for (const char* text : {"{particles: 0}", "{particles: 1000001}", "{resampling: residual}",
                           "{resample_below: 1.5}", "{kernel: sse9}"}) {
    CHECK_THROWS_AS(read(text, got), ConfigurationError);
  }
}
