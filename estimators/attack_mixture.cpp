#include "estimators/attack_mixture.h"

#include <utility>

#include "common/errors.h"
#include "estimators/attack_hypotheses.h"
#include "estimators/attack_sum.h"
#include "estimators/sized_vector_kernel.h"

namespace holdfast {
namespace {

template <int N, int L>
class AttackMixtureMethod {
 public:
  /// learning: sums up each reading; null: nobody wants it.
  AttackMixtureMethod(const AttackMixtureOptions& options, int num_measurements,
                      std::shared_ptr<AttackLearning> learning)
      : num_passes_(options.components_max > 1 ? 1 : options.smoother_passes),
        sum_(static_cast<std::size_t>(options.components_max), options.prune_below),
        components_max_(options.components_max),
        learn_over_steps_(options.learn_over_steps),
        learning_(std::move(learning)) {
    for (const AttackAssumptions::Period& period : options.assumes.periods) {
      const AttackStatistics statistics = period.statistics(num_measurements);
      of_state_.add(period.first_step, AttackHypotheses<N, L>(statistics, options.zero_std));
      of_reading_.add(period.first_step, AttackHypotheses<L, L>(statistics, options.zero_std));
    }
  }

  void begin_step(std::int64_t step) {
    of_state_.begin_step(step);
    of_state_.now().forget();
    sum_.forget(of_state_.now().probabilities());
  }

  bool move(SizedModel<N, L>& model, const Belief<N>& belief, Small<N, N>& cross,
            Belief<N>& predicted) {
    if (!has_sum()) return false;
    if (sum_.num_components() == 0) sum_.start(belief);
    sum_.move(model, cross, predicted);
    return true;
  }

  // Distances are told from readings that nobody touched.
  void believe(const Observation<N, L>& observation, const Small<L, L>& R,
               ReadingBelief<L>& reading) const {
    believe_reading(observation, R, reading);
  }

  VectorResult correct(const Belief<N>& prior, const Observation<N, L>& observation,
                       const ReadingBelief<L>& /*reading*/, SizedModel<N, L>& model,
                       const Small<L>& y, Belief<N>& posterior) {
    const Small<L, L>& R = model.R();
    if (has_sum()) return correct_sum(prior, observation, model, y, posterior);
    const auto found = of_state_.now().update(prior, observation, R, y, posterior);
    if (!found.is_usable) return {};
    sum_up(of_state_.now(), observation, R, y);
    if (learn_over_steps_ > 0.0) learn();
    const bool teaches = of_state_.now().likeliest_reading() != nullptr;
    return {teaches ? VectorResult::Kind::kCorrected : VectorResult::Kind::kSkipped, 0.0,
            found.log_density};
  }

  const ReadingBelief<L>* explained() const {
    return has_sum() ? nullptr : of_state_.now().likeliest_reading();
  }

  void publish(Estimate& estimate) const {
    const AttackHypotheses<N, L>& hypotheses = of_state_.now();
    const auto& probabilities = has_sum() ? sum_.probabilities() : hypotheses.probabilities();
    estimate.hypotheses.resize(kNumAttackHypotheses);
    estimate.mode_probability.resize(kNumAttackHypotheses);
    for (std::size_t i = 0; i < kNumAttackHypotheses; ++i) {
      HypothesisEstimate& one = estimate.hypotheses[i];
      if (one.name.empty()) one.name = attack_hypothesis_names()[i];
      one.probability = estimate.mode_probability[i] = probabilities[i];
      one.num_components = has_sum() ? static_cast<int>(sum_.num_components()) : 0;
      one.num_candidates = has_sum() ? static_cast<int>(sum_.num_candidates()) : 0;
      const Belief<N>* given =
          has_sum() ? nullptr : hypotheses.given(static_cast<AttackHypothesis>(i));
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
        1.0 - probabilities[static_cast<std::size_t>(AttackHypothesis::kUntouched)];
  }

  int num_passes() const { return num_passes_; }

  // The sums of an earlier pass knew less.
  void begin_pass() {
    if (learning_ == nullptr || !learning_->sums_up || learn_over_steps_ > 0.0) return;
    learning_->fit.clear();
  }

  bool tilt(std::int64_t step, const Belief<L>& cavity, const Observation<L, L>& of_s,
            const Small<L, L>& R, const Small<L>& y, Belief<L>& tilted) {
    of_reading_.begin_step(step);
    AttackHypotheses<L, L>& hypotheses = of_reading_.now();
    if (!hypotheses.update(cavity, of_s, R, y, tilted).is_usable) return false;
    if (learn_over_steps_ == 0.0) sum_up(hypotheses, of_s, R, y);
    return !hypotheses.is_certainly_forced();
  }

 private:
  template <int M>
  void sum_up(const AttackHypotheses<M, L>& hypotheses, const Observation<M, L>& observation,
              const Small<L, L>& R, const Small<L>& y) {
    if (learning_ == nullptr || !learning_->sums_up) return;
    learning_->fit.add(observation, R, hypotheses.attack(), learning_->statistics,
                       hypotheses.probabilities(), y);
  }

  bool has_sum() const { return components_max_ > 1; }

  VectorResult correct_sum(const Belief<N>& prior, const Observation<N, L>& observation,
                           SizedModel<N, L>& model, const Small<L>& y, Belief<N>& posterior) {
    if (sum_.num_components() == 0) sum_.start(prior);
    VectorResult result{VectorResult::Kind::kSkipped};
    // The reading as untouched is what kernel and estimate say of it.
    if (!sum_.correct(model, observation, of_state_.now(), y, result.log_density, posterior)) {
      return {};
    }
    const auto& p = sum_.probabilities();
    const bool teaches = p[static_cast<std::size_t>(AttackHypothesis::kForcedToZero)] < 0.5;
    if (teaches) result.kind = VectorResult::Kind::kCorrected;
    return result;
  }

  // Recursive expectation-maximisation: old readings fade, the first guess counts as some.
  void learn() {
    learning_->fit.maximise(learning_->statistics);
    learning_->fit.forget(1.0 - 1.0 / learn_over_steps_);
    of_state_.now().believe(learning_->statistics);
    of_reading_.now().believe(learning_->statistics);
  }

  int num_passes_;
  AttackSum<N, L> sum_;
  int components_max_;
  double learn_over_steps_;
  std::shared_ptr<AttackLearning> learning_;
  PeriodSchedule<AttackHypotheses<N, L>> of_state_;
  PeriodSchedule<AttackHypotheses<L, L>> of_reading_;
};

constexpr double kLearnOverMin = 10.0;

std::shared_ptr<AttackLearning> make_learning(const AttackMixtureOptions& options,
                                              int num_measurements) {
  const AttackStatistics guess = options.assumes.periods.front().statistics(num_measurements);
  auto learning = std::make_shared<AttackLearning>(
      AttackLearning{guess, AttackFit(num_measurements), options.learn_over_steps > 0.0});
  // Learning begins with the first guess as a tenth of what it will remember.
  learning->fit.add_guess(guess, options.learn_over_steps / kLearnOverMin);
  return learning;
}

std::unique_ptr<VectorKernel> make_mixture_kernel(const SystemModel& model,
                                                  const AttackMixtureOptions& options,
                                                  const std::shared_ptr<AttackLearning>& learning) {
  return make_vector_kernel<AttackMixtureMethod, KnownSizes<4, 2>>(
      model, options.linearisation, options.start.gaussian(model.num_states()),
      [&]<int N, int L>() {
        return AttackMixtureMethod<N, L>(options, model.num_measurements(), learning);
      });
}

// The same options with beliefs that stay.
AttackMixtureOptions constant(AttackMixtureOptions options, const AttackStatistics& statistics) {
  options.learn_over_steps = 0.0;
  options.assumes.periods.resize(1);
  options.assumes.periods.front().set(statistics);
  return options;
}

}  // namespace

void AttackMixtureOptions::read(ConfigurationMap& map, const SystemModel& model) {
  VectorFilterOptions::read(map, model);
  assumes.read(map.map("assumes"), model.num_measurements());
  map.read("zero_std", zero_std, kNonNegative);
  map.read("smoother_passes", smoother_passes, {1.0, 100.0});
  map.read("learn_over_steps", learn_over_steps, kNonNegative);
  if (learn_over_steps > 0.0 && learn_over_steps < kLearnOverMin) {
    map.problem("learn_over_steps", "must be 0 or at least 10");
  }
  map.read("components_max", components_max, {1.0, 1000.0});
  map.read("prune_below", prune_below, kProbability);
  if (learn_over_steps > 0.0 && components_max > 1) {
    map.problem("learn_over_steps", "needs components_max: 1");
  }
  if (learn_over_steps > 0.0 && assumes.periods.size() > 1) {
    map.problem("learn_over_steps", "cannot go with assumes.changes: it learns what changes");
  }
}

AttackMixture::AttackMixture(const SystemModel& model, const AttackMixtureOptions& options,
                             std::vector<std::vector<int>> rows)
    : AttackMixture(model, options, std::move(rows),
                    make_learning(options, model.num_measurements())) {}

AttackMixture::AttackMixture(const SystemModel& model, const AttackMixtureOptions& options,
                             std::vector<std::vector<int>> rows,
                             std::shared_ptr<AttackLearning> learning)
    : VectorFilter(make_mixture_kernel(model, options, learning), model, options, rows),
      model_(model),
      options_(options),
      rows_(std::move(rows)),
      learning_(std::move(learning)) {}

std::unique_ptr<AttackMixture> AttackMixture::renewed(const AttackStatistics& statistics) const {
  return std::make_unique<AttackMixture>(model_, constant(options_, statistics), rows_);
}

std::unique_ptr<AttackMixture> AttackMixture::renewed_for_fit(
    const AttackStatistics& statistics) const {
  AttackMixtureOptions options = constant(options_, statistics);
  options.components_max = 1;
  auto filter = std::make_unique<AttackMixture>(model_, options, rows_);
  filter->prepare_fit();
  return filter;
}

std::unique_ptr<VectorKernel> make_kernel(const SystemModel& model,
                                          const AttackMixtureOptions& options) {
  return make_mixture_kernel(model, options, nullptr);
}

}  // namespace holdfast
