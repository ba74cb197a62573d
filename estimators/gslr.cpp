#include "estimators/gslr.h"

#include <utility>

#include "estimators/sized_vector_kernel.h"

namespace holdfast {
namespace {

template <int N, int L>
class GslrMethod {
 public:
  GslrMethod(const GslrOptions& options, int num_measurements)
      : moments_(options.moments), skips_zero_(options.skip_zero) {
    for (const AttackAssumptions::Period& period : options.assumes.periods) {
      const AttackStatistics statistics = period.statistics(num_measurements);
      attacks_.add(period.first_step,
                   SizedAttackStatistics<L>(skips_zero_ ? given_no_dos(statistics) : statistics));
    }
  }

  void begin_step(std::int64_t step) { attacks_.begin_step(step); }

  void believe(const Observation<N, L>& observation, const Small<L, L>& R,
               ReadingBelief<L>& reading) const {
    regress_reading(observation, R, attacks_.now(), moments_, reading);
  }

  VectorResult correct(const Belief<N>& prior, const Observation<N, L>& observation,
                       const ReadingBelief<L>& reading, SizedModel<N, L>& /*model*/,
                       const Small<L>& y, Belief<N>& posterior) {
    const bool is_forced = skips_zero_ && (y.array() == 0.0).all();
    if (is_forced || attacks_.now().moments.s1 == 0.0) return {VectorResult::Kind::kSkipped};
    return correct_once(update_, prior, observation, reading, y, posterior);
  }

  void publish(Estimate& /*estimate*/) const {}

 private:
  RegressionMoments moments_;
  bool skips_zero_;
  PeriodSchedule<SizedAttackStatistics<L>> attacks_;
  GaussianUpdate<N, L> update_;
};

}  // namespace

void GslrOptions::read(ConfigurationMap& map, const SystemModel& model) {
  VectorFilterOptions::read(map, model);
  assumes.read(map.map("assumes"), model.num_measurements());
  map.read_choice("moments", moments,
                  {{"exact", RegressionMoments::kExact}, {"paper", RegressionMoments::kPaper}});
  map.read("skip_zero", skip_zero);
}

AttackStatistics given_no_dos(AttackStatistics statistics) {
  const double no_dos = 1.0 - statistics.attack_probability * statistics.dos_probability;
  // When every reading is forced, nothing is left to believe of the others: leave it as it is.
  if (no_dos <= 0.0) return statistics;
  statistics.attack_probability = 1.0 - (1.0 - statistics.attack_probability) / no_dos;
  statistics.dos_probability = 0.0;
  return statistics;
}

Gslr::Gslr(const SystemModel& model, const GslrOptions& options, std::vector<std::vector<int>> rows)
    : VectorFilter(make_kernel(model, options), model, options, std::move(rows)) {}

std::unique_ptr<VectorKernel> make_kernel(const SystemModel& model, const GslrOptions& options) {
  return make_vector_kernel<GslrMethod, KnownSizes<4, 2>>(
      model, options.linearisation, options.start.gaussian(model.num_states()),
      [&]<int N, int L>() { return GslrMethod<N, L>(options, model.num_measurements()); });
}

}  // namespace holdfast
