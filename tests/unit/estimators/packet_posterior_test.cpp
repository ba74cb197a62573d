// P(packet authentic | Z_k) against a brute-force simulation of the attack chain, eqs. (4)-(8).

#include <cmath>
#include <vector>

#include "common/random_stream.h"
#include "estimators/binary_likelihood.h"
#include "tests/unit/estimators/golden_binary_pf.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

constexpr std::size_t kSize = 16;
constexpr int kNumDraws = 400000;

struct Setting {
  BinaryTargetModel model;
  BinaryTargetModel::Attack attack;
  ParticleSet particles{kSize};
};

Setting make_setting(bool has_radio) {
  Setting setting;
  setting.model.has_radio_channel = has_radio;
  setting.model.sensor_positions_m = {{0.0, 0.0}};
  setting.attack.dos = {0.25};
  setting.attack.deception = {0.3};
  setting.attack.flip = {0.15};
  for (std::size_t i = 0; i < kSize; ++i) {
    setting.particles.component[0][i] = 20.0 + static_cast<double>(i);
  }
  return setting;
}

std::vector<double> posteriors(const Setting& setting, const std::vector<double>& readings,
                               DuplicateRule rule) {
  BinaryLikelihood likelihood(setting.model, setting.attack, rule, false,
                              *particle_kernels().front());
  MeasurementSet set;
  for (const double reading : readings) add_packet(set, 0, reading);
  likelihood.set_measurements(set);
  AlignedArray weights(kSize), q(likelihood.num_factors() * kSize);
  likelihood.log_likelihood(setting.particles, weights.data(), q.data());
  double sum = 0.0;
  for (std::size_t i = 0; i < kSize; ++i) sum += weights[i] = std::exp(weights[i]);
  for (std::size_t i = 0; i < kSize; ++i) weights[i] /= sum;
  std::vector<double> result;
  for (std::size_t p = 0; p < readings.size(); ++p) {
    result.push_back(likelihood.authentic_probability(p, weights.data(), q.data(), kSize));
  }
  return result;
}

struct Sent {
  bool bit = false, is_authentic = false;
};

// One packet of a particle drawn at random, as plant and attacker make it.
Sent draw(const Setting& setting, const RandomStream& stream, std::uint32_t i) {
  const auto& model = setting.model;
  const auto particle = static_cast<std::size_t>(stream.uniform(i, 0) * kSize);
  const double h = model.energy({setting.particles.component[0][particle], 0.0, 0.0, 0.0}, 0);
  const bool is_tail = stream.uniform(i, 1) < model.glint.tail_probability;
  const double variance = is_tail ? model.glint.variance_2 : model.glint.variance_1;
  double reading = h + std::sqrt(variance) * stream.normal(i, 10);
  const bool is_dos = stream.uniform(i, 2) < setting.attack.dos[0];
  const bool is_lie = !is_dos && stream.uniform(i, 3) < setting.attack.deception[0];
  if (is_dos) reading = 0.0;
  if (is_lie) reading = -3.0 + 6.0 * stream.uniform(i, 4);
  const bool is_flipped = stream.uniform(i, 5) < setting.attack.flip[0];
  const bool bit = reading > model.threshold;
  return {bit != is_flipped, !is_dos && !is_lie && !is_flipped};
}

struct Tally {
  double all = 0.0, authentic = 0.0, squares = 0.0;
  void add(double weight, bool is_authentic) {
    all += weight;
    authentic += is_authentic ? weight : 0.0;
    squares += weight * weight;
  }
  double share() const { return authentic / all; }
  // Of a share of weighted draws: at most 1/2 by the square root of their effective number.
  double standard_error() const { return 0.5 * std::sqrt(squares) / all; }
};

}  // namespace

TEST_CASE("packet posterior on a digital bus") {
  const Setting setting = make_setting(false);
  const RandomStream stream(6, 0, "test/digital");
  Tally tally[2];
  for (std::uint32_t i = 0; i < kNumDraws; ++i) {
    const Sent sent = draw(setting, stream, i);
    tally[sent.bit ? 1 : 0].add(1.0, sent.is_authentic);
  }
  for (int bit = 0; bit < 2; ++bit) {
    const double value =
        posteriors(setting, {static_cast<double>(bit)}, DuplicateRule::kAverage)[0];
    CHECK(std::abs(value - tally[bit].share()) < 4.5 * tally[bit].standard_error());
  }
  // Negative control: the prior of being authentic is further off than that.
  CHECK(std::abs(0.75 * 0.7 * 0.85 - tally[0].share()) > 4.5 * tally[0].standard_error());
}

TEST_CASE("packet posterior on the radio channel") {
  const Setting setting = make_setting(true);
  const RandomStream stream(6, 0, "test/radio");
  const std::vector<double> readings = {-0.1, 0.2, 0.26, 0.31, 0.6};
  std::vector<Tally> tally(readings.size());
  for (std::uint32_t i = 0; i < kNumDraws; ++i) {
    const Sent sent = draw(setting, stream, i);
    for (std::size_t r = 0; r < readings.size(); ++r) {
      const double z = (readings[r] - (sent.bit ? 0.5 : 0.0)) / 0.1;
      tally[r].add(std::exp(-0.5 * z * z), sent.is_authentic);
    }
  }
  for (std::size_t r = 0; r < readings.size(); ++r) {
    const double value = posteriors(setting, {readings[r]}, DuplicateRule::kAverage)[0];
    CHECK(std::abs(value - tally[r].share()) < 4.5 * tally[r].standard_error());
  }
}

TEST_CASE("packet posteriors of duplicates: one of them is the sensor's") {
  const Setting setting = make_setting(false);
  const RandomStream stream(6, 0, "test/duplicates");
  const std::vector<double> readings = {1.0, 0.0, 1.0};
  Tally tally[3];
  for (std::uint32_t i = 0; i < kNumDraws; ++i) {
    const Sent sent = draw(setting, stream, i);
    const auto genuine = static_cast<std::size_t>(3.0 * stream.uniform(i, 6));
    if (sent.bit != (readings[genuine] == 1.0)) continue;  // not what was received
    for (std::size_t p = 0; p < 3; ++p) tally[p].add(1.0, p == genuine && sent.is_authentic);
  }
  const auto average = posteriors(setting, readings, DuplicateRule::kAverage);
  for (std::size_t p = 0; p < 3; ++p) {
    CHECK(std::abs(average[p] - tally[p].share()) < 4.5 * tally[p].standard_error());
  }
  const auto first = posteriors(setting, readings, DuplicateRule::kFirst);
  CHECK(first[0] == Approx(posteriors(setting, {1.0}, DuplicateRule::kAverage)[0]));
  CHECK(first[1] == 0.0);
  const auto last = posteriors(setting, {1.0, 0.0}, DuplicateRule::kLast);
  CHECK(last[0] == 0.0);
  CHECK(last[1] == Approx(posteriors(setting, {0.0}, DuplicateRule::kAverage)[0]));
  const auto product = posteriors(setting, {1.0, 1.0}, DuplicateRule::kProduct);
  CHECK(product[0] == Approx(product[1]));
  CHECK(product[0] > average[0]);
}
