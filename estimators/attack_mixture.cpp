#include "estimators/attack_mixture.h"

#include <utility>

#include "common/errors.h"
#include "estimators/attack_hypotheses.h"
#include "estimators/sized_vector_kernel.h"

namespace holdfast {
namespace {

template <int N, int L>
class AttackMixtureMethod {
 public:
  AttackMixtureMethod(const AttackMixtureOptions& options, int num_measurements)
      : num_passes_(options.smoother_passes) {
    for (const AttackAssumptions::Period& period : options.assumes.periods) {
      const AttackStatistics statistics = period.statistics(num_measurements);
      of_state_.add(period.first_step, AttackHypotheses<N, L>(statistics, options.zero_std));
      of_reading_.add(period.first_step, AttackHypotheses<L, L>(statistics, options.zero_std));
    }
  }

  void begin_step(std::int64_t step) {
    of_state_.begin_step(step);
    of_state_.now().forget();
  }

  // Distances are told from readings that nobody touched.
  void believe(const Observation<N, L>& observation, const Small<L, L>& R,
               ReadingBelief<L>& reading) const {
    believe_reading(observation, R, reading);
  }

  VectorResult correct(const Belief<N>& prior, const Observation<N, L>& observation,
                       const ReadingBelief<L>& /*reading*/, const Small<L, L>& R, const Small<L>& y,
                       Belief<N>& posterior) {
    const auto found = of_state_.now().update(prior, observation, R, y, posterior);
    if (!found.is_usable) return {};
    const bool teaches = of_state_.now().likeliest_reading() != nullptr;
    return {teaches ? VectorResult::Kind::kCorrected : VectorResult::Kind::kSkipped, 0.0,
            found.log_density};
  }

  const ReadingBelief<L>* explained() const { return of_state_.now().likeliest_reading(); }

  void publish(Estimate& estimate) const {
    const AttackHypotheses<N, L>& hypotheses = of_state_.now();
    estimate.hypotheses.resize(kNumAttackHypotheses);
    estimate.mode_probability.resize(kNumAttackHypotheses);
    for (std::size_t i = 0; i < kNumAttackHypotheses; ++i) {
      HypothesisEstimate& one = estimate.hypotheses[i];
      if (one.name.empty()) one.name = attack_hypothesis_names()[i];
      one.probability = estimate.mode_probability[i] = hypotheses.probabilities()[i];
      const Belief<N>* given = hypotheses.given(static_cast<AttackHypothesis>(i));
      // Where a hypothesis is ruled out there is no state given it: the filter's own stands.
      if (given != nullptr) {
        one.mean = given->mean;
        one.covariance = given->covariance;
      } else {
        one.mean = estimate.mean;
        one.covariance = estimate.covariance;
      }
    }
    estimate.attack_probability =
        1.0 - hypotheses.probabilities()[static_cast<std::size_t>(AttackHypothesis::kUntouched)];
  }

  int num_passes() const { return num_passes_; }

  bool tilt(std::int64_t step, const Belief<L>& cavity, const Observation<L, L>& of_s,
            const Small<L, L>& R, const Small<L>& y, Belief<L>& tilted) {
    of_reading_.begin_step(step);
    AttackHypotheses<L, L>& hypotheses = of_reading_.now();
    return hypotheses.update(cavity, of_s, R, y, tilted).is_usable &&
           !hypotheses.is_certainly_forced();
  }

 private:
  int num_passes_;
  PeriodSchedule<AttackHypotheses<N, L>> of_state_;
  PeriodSchedule<AttackHypotheses<L, L>> of_reading_;
};

}  // namespace

void AttackMixtureOptions::read(ConfigurationMap& map, const SystemModel& model) {
  VectorFilterOptions::read(map, model);
  assumes.read(map.map("assumes"), model.num_measurements());
  map.read("zero_std", zero_std, kNonNegative);
  map.read("smoother_passes", smoother_passes, {1.0, 100.0});
}

AttackMixture::AttackMixture(const SystemModel& model, const AttackMixtureOptions& options,
                             std::vector<std::vector<int>> rows)
    : VectorFilter(make_kernel(model, options), model, options, std::move(rows)) {}

std::unique_ptr<VectorKernel> make_kernel(const SystemModel& model,
                                          const AttackMixtureOptions& options) {
  return make_vector_kernel<AttackMixtureMethod, KnownSizes<4, 2>>(
      model, options.linearisation, options.start.gaussian(model.num_states()),
      [&]<int N, int L>() { return AttackMixtureMethod<N, L>(options, model.num_measurements()); });
}

}  // namespace holdfast
