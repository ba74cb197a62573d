#include "estimators/resampling.h"

#include <cmath>
#include <numeric>
#include <vector>

#include "common/random_stream.h"
#include "tests/support/catch.h"

using namespace holdfast;

namespace {

std::vector<double> some_weights(std::size_t size) {
  const RandomStream stream(8, 0, "test/weights");
  std::vector<double> weights(size);
  for (std::size_t i = 0; i < size; ++i) weights[i] = std::exp(2.0 * stream.normal(1, i));
  weights[3] = 0.0;
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
  for (double& weight : weights) weight /= sum;
  return weights;
}

enum class Scheme { kSystematic, kStratified, kMultinomial };

std::vector<std::int32_t> resample(Scheme scheme, const std::vector<double>& weights,
                                   std::uint32_t draw) {
  const RandomStream stream(21, 0, "test/resampling");
  std::vector<std::int32_t> ancestors(weights.size());
  std::vector<double> uniforms(weights.size() + 1);
  for (std::size_t i = 0; i < uniforms.size(); ++i) uniforms[i] = stream.uniform(draw, i);
  if (scheme == Scheme::kSystematic) systematic_ancestors(weights, uniforms[0], ancestors);
  if (scheme == Scheme::kStratified) stratified_ancestors(weights, uniforms, ancestors);
  if (scheme == Scheme::kMultinomial) multinomial_ancestors(weights, uniforms, ancestors);
  return ancestors;
}

std::vector<int> offspring(const std::vector<std::int32_t>& ancestors) {
  std::vector<int> counts(ancestors.size(), 0);
  for (const std::int32_t j : ancestors) ++counts.at(static_cast<std::size_t>(j));
  return counts;
}

}  // namespace

TEST_CASE("the ancestor is the first particle whose cumulative weight reaches the target") {
  const std::vector<double> weights = {0.125, 0.0, 0.5, 0.375};
  std::vector<std::int32_t> ancestors(4);
  systematic_ancestors(weights, 0.5, ancestors);  // targets 0.125, 0.375, 0.625, 0.875
  CHECK(ancestors == std::vector<std::int32_t>{0, 2, 2, 3});
  systematic_ancestors(weights, 0.75, ancestors);  // 0.1875, 0.4375, 0.6875, 0.9375
  CHECK(ancestors == std::vector<std::int32_t>{2, 2, 3, 3});
  stratified_ancestors(weights, std::vector<double>{0.4, 0.5, 0.6, 0.1}, ancestors);
  CHECK(ancestors == std::vector<std::int32_t>{0, 2, 3, 3});  // 0.1, 0.375, 0.65, 0.775
}

TEST_CASE("a total below a target ends at the last particle of positive weight") {
  const std::vector<double> weights = {0.5, 0.4, 0.0};
  std::vector<std::int32_t> ancestors(3);
  systematic_ancestors(weights, 0.999, ancestors);
  CHECK(ancestors == std::vector<std::int32_t>{0, 1, 1});
}

TEST_CASE("equal weights keep every particle once, but for multinomial draws") {
  const std::vector<double> weights(64, 1.0 / 64.0);
  for (std::uint32_t draw = 0; draw < 50; ++draw) {
    for (const Scheme scheme : {Scheme::kSystematic, Scheme::kStratified}) {
      const auto ancestors = resample(scheme, weights, draw);
      for (std::size_t i = 0; i < ancestors.size(); ++i) {
        REQUIRE(ancestors[i] == static_cast<std::int32_t>(i));
      }
    }
  }
}

TEST_CASE("offspring: systematic rounds M w down or up, stratified is off by less than two") {
  const auto weights = some_weights(100);
  for (std::uint32_t draw = 0; draw < 500; ++draw) {
    const auto systematic = offspring(resample(Scheme::kSystematic, weights, draw));
    const auto stratified = offspring(resample(Scheme::kStratified, weights, draw));
    for (std::size_t j = 0; j < weights.size(); ++j) {
      const double expected = 100.0 * weights[j];
      REQUIRE(std::abs(systematic[j] - expected) < 1.0 + 1e-9);
      REQUIRE(std::abs(stratified[j] - expected) < 2.0 + 1e-9);
      if (weights[j] == 0.0) REQUIRE(systematic[j] + stratified[j] == 0);
    }
  }
}

TEST_CASE("offspring: expectation M w, variance of the scheme") {
  const auto weights = some_weights(50);
  const int num_draws = 4000;
  for (const Scheme scheme : {Scheme::kSystematic, Scheme::kStratified, Scheme::kMultinomial}) {
    std::vector<double> sum(50, 0.0);
    double squares = 0.0, bound = 0.0;
    for (int draw = 0; draw < num_draws; ++draw) {
      const auto counts = offspring(resample(scheme, weights, static_cast<std::uint32_t>(draw)));
      for (std::size_t j = 0; j < counts.size(); ++j) {
        sum[j] += counts[j];
        squares += std::pow(counts[j] - 50.0 * weights[j], 2) / num_draws;
      }
    }
    bool is_off_by_a_tenth = false;
    for (std::size_t j = 0; j < weights.size(); ++j) {
      const double variance = 50.0 * weights[j] * (1.0 - weights[j]);  // multinomial, the largest
      bound += variance;
      const double error = 4.5 * std::sqrt(variance / num_draws);  // 50 x 3 checks at 7e-6
      CHECK(std::abs(sum[j] / num_draws - 50.0 * weights[j]) <= error);
      is_off_by_a_tenth =
          is_off_by_a_tenth || std::abs(sum[j] / num_draws - 55.0 * weights[j]) > error;
    }
    CHECK(is_off_by_a_tenth);  // negative control
    // Sum of variances: equal to the multinomial one for that scheme (5 s.e. of 4000 draws), less
    // for the others.
    if (scheme == Scheme::kMultinomial) {
      CHECK(squares == Approx(bound).epsilon(0.03));
    } else {
      CHECK(squares < 0.8 * bound);
    }
  }
}

TEST_CASE("effective sample size: M for equal weights, 1 for a single one") {
  CHECK(effective_sample_size(std::vector<double>(10, 0.1)) == Approx(10.0));
  CHECK(effective_sample_size(std::vector<double>{0.0, 1.0, 0.0}) == Approx(1.0));
}
