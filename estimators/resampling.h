#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace holdfast {

/// Ancestors of M = ancestors.size() offspring. weights: normalised. ancestors[i] is the smallest j
/// whose cumulative weight reaches the i-th target, in ascending order; a target that rounding puts
/// above the total goes to the last particle of positive weight. Nothing allocates.

/// One uniform: targets (u + i) / M. Particle j gets M w_j offspring, rounded down or up.
void systematic_ancestors(std::span<const double> weights, double uniform,
                          std::span<std::int32_t> ancestors);

/// M uniforms: targets (u_i + i) / M, one in each of M strata.
void stratified_ancestors(std::span<const double> weights, std::span<const double> uniforms,
                          std::span<std::int32_t> ancestors);

/// M + 1 uniforms: independent draws, sorted. The order statistics of M uniforms come from the
/// spacings of a Poisson process: t_i = (e_0 + .. + e_i) / (e_0 + .. + e_M), e = -log u.
void multinomial_ancestors(std::span<const double> weights, std::span<const double> uniforms,
                           std::span<std::int32_t> ancestors);

/// 1 / sum of squares of normalised weights, Kong's effective sample size.
double effective_sample_size(std::span<const double> weights);

}  // namespace holdfast
