#include "estimators/resampling.h"

#include <cmath>

namespace holdfast {
namespace {

template <class Target>
void merge(std::span<const double> weights, std::span<std::int32_t> ancestors, Target target) {
  std::size_t last = weights.size() - 1;
  while (last > 0 && !(weights[last] > 0.0)) --last;
  std::size_t j = 0;
  double cumulative = weights[0];
  for (std::size_t i = 0; i < ancestors.size(); ++i) {
    const double wanted = target(i);
    while (cumulative < wanted && j < last) cumulative += weights[++j];
    ancestors[i] = static_cast<std::int32_t>(j);
  }
}

}  // namespace

void systematic_ancestors(std::span<const double> weights, double uniform,
                          std::span<std::int32_t> ancestors) {
  const auto count = static_cast<double>(ancestors.size());
  merge(weights, ancestors,
        [=](std::size_t i) { return (uniform + static_cast<double>(i)) / count; });
}

void stratified_ancestors(std::span<const double> weights, std::span<const double> uniforms,
                          std::span<std::int32_t> ancestors) {
  const auto count = static_cast<double>(ancestors.size());
  merge(weights, ancestors,
        [=](std::size_t i) { return (uniforms[i] + static_cast<double>(i)) / count; });
}

void multinomial_ancestors(std::span<const double> weights, std::span<const double> uniforms,
                           std::span<std::int32_t> ancestors) {
  double total = 0.0;
  for (std::size_t i = 0; i <= ancestors.size(); ++i) total -= std::log(uniforms[i]);
  double sum = 0.0;
  merge(weights, ancestors, [&](std::size_t i) {
    sum -= std::log(uniforms[i]);
    return sum / total;
  });
}

double effective_sample_size(std::span<const double> weights) {
  double sum = 0.0;
  for (const double weight : weights) sum += weight * weight;
  return 1.0 / sum;
}

}  // namespace holdfast
