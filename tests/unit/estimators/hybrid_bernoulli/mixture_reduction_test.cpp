// Merging against the table of Vo and Ma (2006), done the slow way.
#include "estimators/mixture_reduction.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "common/random_stream.h"
#include "tests/support/catch.h"

namespace holdfast {
namespace {

struct Gaussian {
  double weight = 0.0;
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
};

Gaussian merged(const std::vector<Gaussian>& cluster) {
  Gaussian sum = {0.0, Eigen::VectorXd::Zero(cluster[0].mean.size()),
                  Eigen::MatrixXd::Zero(cluster[0].mean.size(), cluster[0].mean.size())};
  for (const Gaussian& it : cluster) {
    sum.weight += it.weight;
    sum.mean += it.weight * it.mean;
  }
  sum.mean /= sum.weight;
  for (const Gaussian& it : cluster) {
    const Eigen::VectorXd offset = it.mean - sum.mean;
    sum.covariance += it.weight / sum.weight * (it.covariance + offset * offset.transpose());
  }
  return sum;
}

std::vector<Gaussian> reduced_slowly(std::vector<Gaussian> rest,
                                     const HybridBernoulliOptions& options) {
  const bool is_own = options.merge_metric == HybridBernoulliOptions::MergeMetric::kOwn;
  std::vector<Gaussian> made;
  while (!rest.empty()) {
    const Gaussian dominant =
        *std::max_element(rest.begin(), rest.end(),
                          [](const Gaussian& a, const Gaussian& b) { return a.weight < b.weight; });
    std::vector<Gaussian> cluster, others;
    for (const Gaussian& it : rest) {
      const Eigen::VectorXd offset = it.mean - dominant.mean;
      const Eigen::MatrixXd& metric = is_own ? it.covariance : dominant.covariance;
      const double squared = offset.dot(metric.llt().solve(offset));
      (squared <= options.merge_below ? cluster : others).push_back(it);
    }
    made.push_back(merged(cluster));
    rest = others;
  }
  return made;
}

/// Correlated components of very different scales, on a grid about as wide as they reach.
std::vector<Gaussian> random_components(const RandomStream& stream, std::uint32_t step, int d,
                                        int count, double spread) {
  std::uint64_t draw = 0;
  const auto normal = [&] { return stream.normal(step, draw++); };
  std::vector<Gaussian> made;
  for (int j = 0; j < count; ++j) {
    Eigen::MatrixXd factor(d, d);
    Eigen::VectorXd mean(d), scale(d);
    for (int i = 0; i < d; ++i) scale[i] = std::pow(10.0, i % 4 - 2);
    for (double& value : factor.reshaped()) value = normal();
    for (double& value : mean) value = spread * normal();
    factor = scale.asDiagonal() * factor;
    made.push_back(
        {0.1 + std::abs(normal()), scale.cwiseProduct(mean),
         factor * factor.transpose() + 0.01 * Eigen::MatrixXd(scale.cwiseAbs2().asDiagonal())});
  }
  return made;
}

}  // namespace

TEST_CASE("components merge as the table says, whoever measures the distance") {
  const RandomStream stream(5, 0, "tests/mixture_reduction");
  HybridBernoulliOptions options;
  options.components_max = 1000;
  int num_merged = 0, num_apart = 0;
  for (std::uint32_t step = 0; step < 120; ++step) {
    const int d = 1 + static_cast<int>(step % 7), count = 12;
    options.merge_below = step % 3 == 0 ? 3.0 : 0.5 * d;
    options.merge_metric = step % 2 == 0 ? HybridBernoulliOptions::MergeMetric::kOwn
                                         : HybridBernoulliOptions::MergeMetric::kDominant;
    const auto components = random_components(stream, step, d, count, step % 5 < 3 ? 0.6 : 2.0);
    GaussianMixture mixture(d), reduced(d);
    for (const Gaussian& it : components) mixture.add(std::log(it.weight), it.mean, it.covariance);
    MixtureReduction(options).reduce(mixture, reduced);
    const auto expected = reduced_slowly(components, options);
    CAPTURE(step);
    REQUIRE(reduced.size() == static_cast<int>(expected.size()));
    const double sum =
        std::accumulate(components.begin(), components.end(), 0.0,
                        [](double total, const Gaussian& it) { return total + it.weight; });
    for (int j = 0; j < reduced.size(); ++j) {
      const Gaussian& other = expected[static_cast<std::size_t>(j)];
      CHECK(reduced.weight(j) == Approx(other.weight / sum).epsilon(1e-12));
      CHECK((reduced.mean(j) - other.mean).norm() <= 1e-10 * (1.0 + other.mean.norm()));
      CHECK((reduced.covariance(j) - other.covariance).norm() <= 1e-10 * other.covariance.norm());
    }
    num_merged += count - reduced.size();
    num_apart += reduced.size() - 1;
  }
  CHECK(num_merged > 200);
  CHECK(num_apart > 200);
}

TEST_CASE("a direction without variance keeps nobody apart") {
  HybridBernoulliOptions options;
  options.merge_below = 3.0;
  const Eigen::Matrix2d flat = Eigen::Vector2d(1.0, 0.0).asDiagonal();
  for (const double offset : {1.0, 2.0}) {
    GaussianMixture mixture(2), reduced(2);
    mixture.add(std::log(0.6), Eigen::Vector2d(0.0, 5.0), flat);
    mixture.add(std::log(0.4), Eigen::Vector2d(offset, 5.0 + 1e-15), flat);
    MixtureReduction(options).reduce(mixture, reduced);
    CHECK(reduced.size() == (offset < 1.5 ? 1 : 2));
  }
}

}  // namespace holdfast
