// An attack on a whole measurement vector, put together from rules that refer to each other:
//   y = xb z + (1 - xb) xc (1 + xm (m - 1)) (z + xa a)
// xb: not attacked, xc: not forced to zero, xa: biased, xm: scaled; one of each, and one m, per
// step.
#include <array>
#include <cmath>

#include "tests/support/catch.h"
#include "tests/unit/attacker/proxy_bench.h"

using namespace holdfast;
using namespace holdfast::test;

namespace {

constexpr double kNotAttacked = 0.7, kNotForced = 0.9, kBiased = 0.3, kScaled = 0.2;
constexpr std::array<double, 2> kReading = {2.0, -3.0};
constexpr std::array<double, 2> kBiasMean = {0.7, 0.9}, kBiasStd = {1.0, 0.7071};
constexpr double kFactorMean = 0.8, kFactorStd = 0.6;

std::string rules(const char* factor_draw) {
  return R"(
attacks:
  - {name: attack, action: arm, probability: 0.3, draw: step}
  - {name: dos, given: attack, action: force, signals: [LEFT, RIGHT], probability: 0.1, draw: step}
  - {name: bias, given: attack, unless: dos, action: add, signals: [LEFT, RIGHT], probability: 0.3, draw: step,
     value: {distribution: normal, mean: [0.7, 0.9], std: [1, 0.7071]}}
  - {name: scaling, given: attack, unless: dos, action: scale, signals: [LEFT, RIGHT], probability: 0.2, draw: step,
     value: {distribution: normal, mean: 0.8, std: 0.6, draw: )" +
         std::string(factor_draw) + "}}\n";
}

// Vectors that arrive in steps 1..num_steps when the sensors always say kReading.
std::vector<std::array<double, 2>> attacked(const std::string& yaml, int num_steps) {
  const FrameLayout layout = test_layout();
  const DbcMessage& message = *layout.dbc.find("Pair");
  CanFrame frame = message.empty_frame();
  for (std::size_t i = 0; i < 2; ++i) {
    message.signals[i].pack({frame.data.data(), frame.num_bytes}, kReading[i]);
  }
  ProxyCore proxy(rules_of(yaml), layout, 1, 0, 1.0);
  ProxyOutput out;
  std::vector<std::array<double, 2>> vectors;
  for (int step = 1; step <= num_steps; ++step) {
    out.clear();
    proxy.on_frame(frame, out);
    proxy.end_step(out);
    vectors.push_back({message.signals[0].unpack(out.frames[0].bytes()),
                       message.signals[1].unpack(out.frames[0].bytes())});
  }
  return vectors;
}

// y^p0 y^p1 of the model, by the law of total probability over xb, xc, xa, xm and with the closed
// moments of the normal a and m. Precondition: powers up to 2.
double moment(int power_0, int power_1) {
  const auto normal_moment = [](double mean, double std, int power) {
    const double m2 = mean * mean, v = std * std;
    const std::array<double, 5> moments = {1.0, mean, m2 + v, mean * (m2 + 3.0 * v),
                                           m2 * m2 + 6.0 * m2 * v + 3.0 * v * v};
    return moments.at(static_cast<std::size_t>(power));
  };
  const double factor =
      1.0 - kScaled + kScaled * normal_moment(kFactorMean, kFactorStd, power_0 + power_1);
  const auto plain = std::pow(kReading[0], power_0) * std::pow(kReading[1], power_1);
  const double biased = normal_moment(kReading[0] + kBiasMean[0], kBiasStd[0], power_0) *
                        normal_moment(kReading[1] + kBiasMean[1], kBiasStd[1], power_1);
  return kNotAttacked * plain +
         (1.0 - kNotAttacked) * kNotForced * factor * ((1.0 - kBiased) * plain + kBiased * biased);
}

// Means of y0, y1, y0^2, y1^2, y0 y1, each as (measured - true) in standard deviations of a mean.
std::array<double, 5> deviations(const std::vector<std::array<double, 2>>& vectors,
                                 double tampering = 0.0) {
  constexpr std::array<std::array<int, 2>, 5> kPowers = {{{1, 0}, {0, 1}, {2, 0}, {0, 2}, {1, 1}}};
  std::array<double, 5> result{};
  const auto n = static_cast<double>(vectors.size());
  for (std::size_t i = 0; i < kPowers.size(); ++i) {
    const auto [p, q] = kPowers[i];
    double sum = 0.0;
    for (const auto& y : vectors) sum += std::pow(y[0], p) * std::pow(y[1], q);
    const double expected = moment(p, q);
    const double variance = moment(2 * p, 2 * q) - expected * expected;
    result[i] = (sum / n - expected * (1.0 + tampering)) / std::sqrt(variance / n);
  }
  return result;
}

}  // namespace

TEST_CASE("the moments that the test expects are the model's closed forms") {
  const double g1 = 1.0 + kScaled * (kFactorMean - 1.0);
  const double c1 = (1.0 - kNotAttacked) * kNotForced * g1;
  const double s1 = kNotAttacked + c1;
  const double c2 =
      (1.0 - kNotAttacked) * kNotForced *
      (1.0 - kScaled + kScaled * (kFactorStd * kFactorStd + kFactorMean * kFactorMean));
  const double s2 = kNotAttacked + c2;
  for (std::size_t i = 0; i < 2; ++i) {
    const double z = kReading[i], mu = kBiasMean[i], variance = kBiasStd[i] * kBiasStd[i];
    CHECK(moment(i == 0, i == 1) == Approx(s1 * z + c1 * kBiased * mu).epsilon(1e-12));
    CHECK(moment(2 * (i == 0), 2 * (i == 1)) ==
          Approx(s2 * z * z + c2 * kBiased * (2.0 * mu * z + mu * mu + variance)).epsilon(1e-12));
  }
  CHECK(moment(1, 1) == Approx(s2 * kReading[0] * kReading[1] +
                               c2 * kBiased *
                                   (kBiasMean[1] * kReading[0] + kBiasMean[0] * kReading[1] +
                                    kBiasMean[0] * kBiasMean[1]))
                            .epsilon(1e-12));
}

TEST_CASE("means, squares and the product of an attacked vector are those of the model") {
  const std::vector<std::array<double, 2>> vectors = attacked(rules("step"), 200000);
  // Two-sided 7e-6 each. A float reading is rounded by 6e-8 of itself, far below 1e-3 of a
  // deviation.
  for (const double deviation : deviations(vectors)) CHECK(std::abs(deviation) < 4.5);
  // Negative controls: moments off by 5 %, and a factor that each signal draws for itself.
  for (const double deviation : deviations(vectors, 0.05)) CHECK(std::abs(deviation) > 4.5);
  const auto apart = deviations(attacked(rules("signal"), 200000));
  CHECK(std::abs(apart[0]) < 4.5);
  CHECK(std::abs(apart[1]) < 4.5);
  CHECK(std::abs(apart[4]) > 4.5);
}

TEST_CASE("one factor scales all signals of a step, the bias with them") {
  const auto without_scaling = [](std::string yaml) {
    return yaml.replace(yaml.find("probability: 0.2"), 16, "probability: 0.0");
  };
  const auto scaled = attacked(rules("step"), 20000);
  const auto unscaled = attacked(without_scaling(rules("step")), 20000);
  int num_scaled = 0, num_scaled_and_biased = 0;
  for (std::size_t k = 0; k < scaled.size(); ++k) {
    if (scaled[k] == unscaled[k]) continue;
    ++num_scaled;
    num_scaled_and_biased += unscaled[k] != kReading;
    // y0 / u0 = y1 / u1 without a division; each of the four numbers is a rounded float.
    const double left = scaled[k][0] * unscaled[k][1], right = scaled[k][1] * unscaled[k][0];
    CHECK(std::abs(left - right) <= 4.0 * 0x1p-24 * std::abs(left));
  }
  // Binomial (20000, 0.3 * 0.9 * 0.2) and of those 0.3 biased: 4.5 deviations.
  CHECK(std::abs(num_scaled - 1080) < 4.5 * std::sqrt(1080.0 * 0.946));
  CHECK(std::abs(num_scaled_and_biased - 324) < 4.5 * std::sqrt(324.0));
}
