#include "estimators/kalman_filter.h"

#include <utility>

#include "common/chi_square.h"
#include "estimators/sized_vector_kernel.h"

namespace holdfast {
namespace {

template <int N, int L>
class KalmanMethod {
 public:
  explicit KalmanMethod(bool skips_zero) : skips_zero_(skips_zero) {}

  void begin_step(std::int64_t /*step*/) {}

  void believe(const Observation<N, L>& observation, const Small<L, L>& R,
               ReadingBelief<L>& reading) const {
    believe_reading(observation, R, reading);
  }

  VectorResult correct(const Belief<N>& prior, const Observation<N, L>& observation,
                       const ReadingBelief<L>& reading, SizedModel<N, L>& /*model*/,
                       const Small<L>& y, Belief<N>& posterior) {
    if (skips_zero_ && (y.array() == 0.0).all()) return {VectorResult::Kind::kSkipped};
    return correct_once(update_, prior, observation, reading, y, posterior);
  }

  void publish(Estimate& /*estimate*/) const {}

 private:
  bool skips_zero_;
  GaussianUpdate<N, L> update_;
};

}  // namespace

KalmanFilter::KalmanFilter(const SystemModel& model, const KalmanFilterOptions& options,
                           std::vector<std::vector<int>> rows)
    : VectorFilter(make_kernel(model, options), model, options, std::move(rows)) {}

std::unique_ptr<VectorKernel> make_kernel(const SystemModel& model,
                                          const KalmanFilterOptions& options) {
  return make_vector_kernel<KalmanMethod, KnownSizes<4, 2>, KnownSizes<12, 12>>(
      model, options.linearisation, options.start.gaussian(model.num_states()),
      [&options]<int N, int L>() { return KalmanMethod<N, L>(options.skip_zero); });
}

void KalmanFilter::judge(const Finding& finding, Estimate& estimate) {
  using Choice = PacketChoice::Result;
  if (finding.choice == Choice::kRefusedByGate) {
    score_ = finding.refused_score;
  } else if (finding.choice == Choice::kCorrected) {
    // A vector of zeros that is skipped is certain to be forced.
    score_ = finding.result.kind == VectorResult::Kind::kSkipped
                 ? 1.0
                 : chi_square_distribution(finding.result.squared_distance, finding.num_rows);
  }
  estimate.attack_probability = score_;
}

}  // namespace holdfast
