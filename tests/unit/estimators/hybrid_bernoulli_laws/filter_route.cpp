#include "tests/unit/estimators/hybrid_bernoulli_laws/filter_route.h"

#include <algorithm>
#include <limits>

#include "tests/unit/estimators/hybrid_bernoulli_laws/sequence_enumeration.h"

namespace holdfast::testing {
namespace {

HybridBernoulliOptions::Correction correction_of(const LawCase& law) {
  const auto is = [&](CorrectionLaw correction) {
    return std::all_of(law.steps.begin(), law.steps.end(),
                       [&](const LawStep& step) { return step.correction == correction; });
  };
  if (is(kInjection)) return HybridBernoulliOptions::Correction::kInjection;
  if (is(kSubstitution)) return HybridBernoulliOptions::Correction::kSubstitution;
  return HybridBernoulliOptions::Correction::kAuto;
}

HybridBernoulliOptions changed(HybridBernoulliOptions options, const FilterRoute::Change& change) {
  if (change) change(options);
  return options;
}

HybridBernoulliOptions options_of(const LawCase& law) {
  HybridBernoulliOptions options;
  options.birth_probability = law.pb;
  options.survival_probability = law.ps;
  options.delivery_probability = law.pd;
  if (law.is_delivery_unknown()) {
    options.delivery_prior = BetaPrior{law.delivered_count, law.lost_count};
  }
  options.substitution_probability = law.pf;
  options.correction = correction_of(law);
  options.feedthrough = law.is_direct ? HybridBernoulliOptions::Feedthrough::kDirect
                                      : HybridBernoulliOptions::Feedthrough::kDelayed;
  for (const AttackLaw& attack : law.attacks) {
    AttackModel model{"attack_" + std::to_string(options.attack_models.size()),
                      attack.probability,
                      attack.channels,
                      {}};
    for (const SignalTerm& term : attack.terms) {
      model.terms.push_back({term.weight, term.mean, term.covariance});
    }
    options.attack_models.push_back(model);
  }
  options.attack_model_persistence = law.persistence;
  options.start_attack_probability = law.start_probability;
  options.start_mean = law.start_mean;
  options.start_covariance = law.start_covariance;
  options.packet_box_low = law.box_low;
  options.packet_box_high = law.box_high;
  options.outside_floor = law.floor;
  if (law.outside == OutsideLaw::kFloor) options.outside = HybridBernoulliOptions::Outside::kFloor;
  if (law.outside == OutsideLaw::kZero) options.outside = HybridBernoulliOptions::Outside::kZero;
  options.prune_below = 0.0;
  options.merge_below = 0.0;
  options.components_max = 1 << 20;
  return options;
}

// Raw moments of some variables, over part of a mixture.
struct Moments {
  double weight = 0.0;
  Eigen::VectorXd mean;
  Eigen::MatrixXd square;

  explicit Moments(Eigen::Index size)
      : mean(Eigen::VectorXd::Zero(size)), square(Eigen::MatrixXd::Zero(size, size)) {}
  void add(const GaussianMixture& mixture, int j, double factor, Eigen::Index first) {
    const Eigen::Index size = mean.size();
    const double mass = factor * mixture.weight(j);
    const Eigen::VectorXd part = mixture.mean(j).segment(first, size);
    weight += mass;
    mean += mass * part;
    square +=
        mass * (mixture.covariance(j).block(first, first, size, size) + part * part.transpose());
  }
};

}  // namespace

FilterRoute::FilterRoute(const LawCase& law, const Change& change)
    : num_attacks_(law.attacks.size()),
      filter_(law.model, changed(options_of(law), change), law.rows) {}

LawPosterior FilterRoute::step(const LawStep& step) {
  set_.clear(set_.step + 1, 0);
  for (const LawPacket& packet : step.packets) {
    Packet head;
    head.source = packet.source;
    head.rx_index = static_cast<std::int64_t>(set_.packets.size());
    set_.add(head, {packet.y.data(), static_cast<std::size_t>(packet.y.size())});
  }
  estimate_ = &filter_.step(set_.step, set_, Eigen::VectorXd());
  return posterior();
}

LawPosterior FilterRoute::posterior() const {
  const HybridBernoulliLayout& layout = filter_.layout();
  const Eigen::Index n = layout.num_states, m = layout.num_channels;
  const double r = filter_.attack_probability();
  LawPosterior result;
  result.r = r;
  result.attack_probability.assign(num_attacks_, 0.0);
  Moments calm(n), attacked(n + m), before(m);
  for (int j = 0; j < filter_.p0().size(); ++j) {
    calm.add(filter_.p0(), j, 1.0, 0);
    if (layout.has_memory && filter_.p0().tag(j).was_attacked) {
      before.add(filter_.p0(), j, 1.0 - r, n);
    }
  }
  for (int j = 0; j < filter_.p1().size(); ++j) {
    attacked.add(filter_.p1(), j, 1.0, 0);
    const ComponentTag& tag = filter_.p1().tag(j);
    result.attack_probability.at(static_cast<std::size_t>(std::max(0, tag.attack_model))) +=
        filter_.p1().weight(j);
    if (layout.has_memory && tag.was_attacked) before.add(filter_.p1(), j, r, n + m);
  }
  result.mean0 = calm.mean;
  result.square0 = calm.square;
  result.mean1 = attacked.mean;
  result.square1 = attacked.square;
  if (before.weight > 0.0) {
    result.r_before = before.weight;
    result.mean_before = before.mean / before.weight;
    result.square_before = before.square / before.weight;
  }
  result.packet_probability = estimate_->packet_probability;
  result.delivery_probability = filter_.delivery_probability();
  return result;
}

double enumeration_disagreement(const LawCase& law) {
  FilterRoute filter(law);
  double worst = 0.0;
  for (std::size_t k = 0; k < law.steps.size(); ++k) {
    worst = worse(worst, disagreement(filter.step(law.steps[k]), enumerate_sequences(law, k + 1)));
  }
  return worst;
}

}  // namespace holdfast::testing
