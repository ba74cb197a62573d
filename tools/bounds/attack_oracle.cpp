#include "tools/bounds/attack_oracle.h"

#include <utility>

#include "estimators/attacked_reading.h"
#include "estimators/sized_vector_kernel.h"

namespace holdfast {
namespace {

template <int N, int L>
class OracleMethod {
 public:
  OracleMethod(const AttackOracleOptions& options, int num_measurements,
               std::shared_ptr<const AttackHypothesis> truth)
      : truth_(std::move(truth)) {
    for (const AttackAssumptions::Period& period : options.assumes.periods) {
      attacks_.add(period.first_step,
                   SizedAttackStatistics<L>(period.statistics(num_measurements)));
    }
  }

  void begin_step(std::int64_t step) { attacks_.begin_step(step); }

  void believe(const Observation<N, L>& observation, const Small<L, L>& R,
               ReadingBelief<L>& reading) const {
    believe_hypothesis(observation, R, attacks_.now(), *truth_, reading);
  }

  VectorResult correct(const Belief<N>& prior, const Observation<N, L>& observation,
                       const ReadingBelief<L>& reading, SizedModel<N, L>& /*model*/,
                       const Small<L>& y, Belief<N>& posterior) {
    if (*truth_ == AttackHypothesis::kForcedToZero) return {VectorResult::Kind::kSkipped};
    return correct_once(update_, prior, observation, reading, y, posterior);
  }

  void publish(Estimate& /*estimate*/) const {}

 private:
  std::shared_ptr<const AttackHypothesis> truth_;
  PeriodSchedule<SizedAttackStatistics<L>> attacks_;
  GaussianUpdate<N, L> update_;
};

}  // namespace

void AttackOracleOptions::read(ConfigurationMap& map, const SystemModel& model) {
  VectorFilterOptions::read(map, model);
  assumes.read(map.map("assumes"), model.num_measurements());
}

AttackOracle::AttackOracle(const SystemModel& model, const AttackOracleOptions& options,
                           std::vector<std::vector<int>> rows)
    : AttackOracle(model, options, std::move(rows),
                   std::make_shared<AttackHypothesis>(AttackHypothesis::kUntouched)) {}

AttackOracle::AttackOracle(const SystemModel& model, const AttackOracleOptions& options,
                           std::vector<std::vector<int>> rows, SharedTruth truth)
    : VectorFilter(make_vector_kernel<OracleMethod, KnownSizes<4, 2>>(
                       model, options.linearisation, options.start.gaussian(model.num_states()),
                       [&]<int N, int L>() {
                         return OracleMethod<N, L>(options, model.num_measurements(), truth);
                       }),
                   model, options, std::move(rows)),
      truth_(std::move(truth)) {}

void AttackOracle::judge(const Finding& /*finding*/, Estimate& estimate) {
  estimate.attack_probability = *truth_ == AttackHypothesis::kUntouched ? 0.0 : 1.0;
}

}  // namespace holdfast
