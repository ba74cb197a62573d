#pragma once

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/measurement_set.h"
#include "common/models/system_model.h"
#include "estimators/hybrid_bernoulli_belief.h"
#include "estimators/hybrid_bernoulli_options.h"
#include "tests/support/catch.h"
#include "tests/support/golden.h"

namespace holdfast::testing {

inline nlohmann::json golden_hbf(const std::string& file) {
  return golden_file("hbf/" + file);
}

inline SystemModel system_of(const nlohmann::json& model) {
  SystemModel system;
  system.A = matrix_of(model.at("A"));
  system.G = matrix_of(model.at("G"));
  system.C = matrix_of(model.at("C"));
  system.H = matrix_of(model.at("H"));
  system.Q = matrix_of(model.at("Q"));
  system.R = matrix_of(model.at("R"));
  return system;
}

/// kappa: {lo, hi, outside: "constant", "zero" or a floor}.
inline void read_box(const nlohmann::json& kappa, HybridBernoulliOptions& options) {
  using Outside = HybridBernoulliOptions::Outside;
  options.packet_box_low = vector_of(kappa.at("lo"));
  options.packet_box_high = vector_of(kappa.at("hi"));
  const nlohmann::json& outside = kappa.at("outside");
  options.outside = outside.is_number()     ? Outside::kFloor
                    : outside == "constant" ? Outside::kConstant
                                            : Outside::kZero;
  if (outside.is_number()) options.outside_floor = outside;
}

/// Options of a golden case that keep every component.
inline HybridBernoulliOptions options_of(const nlohmann::json& model, const std::string& kind) {
  HybridBernoulliOptions options;
  options.birth_probability = model.at("pb");
  options.survival_probability = model.at("ps");
  options.delivery_probability = model.at("pd");
  options.substitution_probability = model.at("pf");
  options.feedthrough = model.at("feedthrough").get<bool>()
                            ? HybridBernoulliOptions::Feedthrough::kDirect
                            : HybridBernoulliOptions::Feedthrough::kDelayed;
  options.correction = kind == "injection" ? HybridBernoulliOptions::Correction::kInjection
                                           : HybridBernoulliOptions::Correction::kSubstitution;
  AttackModel attack;
  for (int c = 0; c < static_cast<int>(matrix_of(model.at("G")).cols()); ++c) {
    attack.channels.push_back(c);
  }
  const nlohmann::json& prior = model.at("prior_a");
  for (std::size_t h = 0; h < prior.at("w").size(); ++h) {
    attack.terms.push_back(
        {prior.at("w").at(h), vector_of(prior.at("m").at(h)), matrix_of(prior.at("P").at(h))});
  }
  options.attack_models = {attack};
  read_box(model.at("kappa"), options);
  options.prune_below = 0.0;
  options.merge_below = 0.0;
  options.components_max = 10000;
  return options;
}

inline GaussianMixture mixture_of(const nlohmann::json& mixture, int attack_model) {
  GaussianMixture made(static_cast<int>(mixture.at("m").at(0).size()));
  ComponentTag tag;
  tag.attack_model = attack_model;
  for (std::size_t j = 0; j < mixture.at("w").size(); ++j) {
    made.add(std::log(mixture.at("w").at(j).get<double>()), vector_of(mixture.at("m").at(j)),
             matrix_of(mixture.at("P").at(j)), tag);
  }
  return made;
}

inline HybridBernoulliBelief belief_of(const nlohmann::json& triplet) {
  HybridBernoulliBelief belief;
  belief.set_log_odds(triplet.at("log_odds").get<double>());
  belief.p0 = mixture_of(triplet.at("p0"), -1);
  belief.p1 = mixture_of(triplet.at("p1"), 0);
  return belief;
}

inline MeasurementSet packets_of(const nlohmann::json& Z) {
  MeasurementSet set;
  set.clear(1, 1);
  for (const nlohmann::json& y : Z) {
    Packet packet;
    packet.rx_index = static_cast<std::int64_t>(set.packets.size());
    set.add(packet, y.get<std::vector<double>>());
  }
  return set;
}

/// One source that carries all rows of y.
inline std::vector<std::vector<int>> all_rows(const SystemModel& system) {
  std::vector<int> rows;
  for (int i = 0; i < system.num_measurements(); ++i) rows.push_back(i);
  return {rows};
}

/// Relative to max(1, |wanted|), as the golden files state their bound.
template <class Made, class Wanted>
double largest_error(const Made& made, const Wanted& wanted) {
  return ((made - wanted).array().abs() / wanted.array().abs().max(1.0)).maxCoeff();
}

inline double largest_error(double made, double wanted) {
  return std::abs(made - wanted) / std::max(1.0, std::abs(wanted));
}

/// The largest error of weights, means and covariances, each component of `wanted` being compared
/// with the one of `made` that is nearest to it; components without weight are left out.
inline double mixture_error(const GaussianMixture& made, const GaussianMixture& wanted,
                            double negligible) {
  double error = 0.0, sum_made = 0.0, sum_matched = 0.0;
  for (int j = 0; j < made.size(); ++j) sum_made += made.weight(j);
  std::vector<char> is_taken(static_cast<std::size_t>(made.size()), 0);
  for (int j = 0; j < wanted.size(); ++j) {
    if (wanted.weight(j) <= negligible) continue;
    double least = 1e300;
    int best = -1;
    for (int i = 0; i < made.size(); ++i) {
      if (is_taken[static_cast<std::size_t>(i)] != 0) continue;
      const double own = std::max({largest_error(made.mean(i), wanted.mean(j)),
                                   largest_error(made.covariance(i), wanted.covariance(j)),
                                   largest_error(made.weight(i), wanted.weight(j))});
      if (own < least) least = own, best = i;
    }
    if (best < 0) return 1e300;
    is_taken[static_cast<std::size_t>(best)] = 1;
    sum_matched += made.weight(best);
    error = std::max(error, least);
  }
  return std::max({error, std::abs(sum_made - 1.0), std::abs(sum_matched - sum_made)});
}

}  // namespace holdfast::testing
