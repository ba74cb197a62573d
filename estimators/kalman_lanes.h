#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "common/errors.h"
#include "common/models/system_model.h"
#include "estimators/gaussian_update.h"
#include "estimators/kalman_core.h"
#include "estimators/small_product.h"

namespace holdfast {

/// Kalman filters of one linear model over many runs at once, for Monte Carlo of one's own: where
/// every reading of every run arrives, covariance and gain are the same in all runs, so they are
/// found once a step, and means go through vector registers, a run in each lane. N and L: 2, 4, 8,
/// 12 or 16. One thread; allocates nothing after construction.
///
/// The numbers are those of a KalmanFilter for each run: to the bit where that is compiled for the
/// sizes (4 x 2, 12 x 12) and both without fused multiplications (-ffp-contract=off), else but for
/// rounding.
template <int N, int L>
class KalmanLanes {
  // Sizes of which products take the same two chains of sums here and in small_product.h.
  static_assert((N == 2 || N == 4 || N == 8 || N == 12 || N == 16) &&
                    (L == 2 || L == 4 || L == 8 || L == 12 || L == 16),
                "sizes of filters in lanes are 2, 4, 8, 12 or 16");

 public:
  /// All runs begin with N(start.mean, start.covariance) at step 0. Throws UsageError when the
  /// model has problems(), is not linear, or is not of N states and L measurements.
  KalmanLanes(const SystemModel& model, const Gaussian& start, std::size_t num_runs)
      : num_runs_(num_runs), num_padded_((num_runs + kSize - 1) / kSize * kSize) {
    const std::vector<std::string> problems = model.problems();
    if (!problems.empty()) throw UsageError("model: " + problems.front());
    if (!model.is_linear() || model.num_states() != N || model.num_measurements() != L ||
        start.mean.size() != N || start.covariance.rows() != N || start.covariance.cols() != N) {
      throw UsageError("filters in lanes need a linear model, and model and start of their sizes");
    }
    F_ = model.A;
    Q_ = model.Q;
    H_ = model.C;
    R_ = model.R;
    belief_.mean.setZero();
    belief_.covariance = start.covariance;
    means_.resize(N * num_padded_);
    for (int i = 0; i < N; ++i) {
      for (std::size_t run = 0; run < num_padded_; ++run) {
        means_[static_cast<std::size_t>(i) * num_padded_ + run] = start.mean[i];
      }
    }
  }

  /// Predicts, and corrects run r by (readings[r], readings[num_runs + r], ..): [L x num_runs], row
  /// by row. squared_distances, log_densities: [num_runs], of nu and of y. False, with the
  /// predictions for means and nothing written, when S is not positive definite. Precondition:
  /// spans of those sizes.
  bool step(std::span<const double> readings, std::span<double> squared_distances,
            std::span<double> log_densities) {
    predict_linear(F_, Q_, belief_, cross_, predicted_);
    observe_linear(H_, predicted_, observation_);
    believe_reading(observation_, R_, reading_);
    const UpdateResult at_mean = update_.weigh(observation_, reading_, reading_.mean);
    if (at_mean.is_definite) {
      update_.apply(predicted_, observation_, reading_, belief_);
    } else {
      belief_ = predicted_;
    }
    for (std::size_t run = 0; run < num_runs_; run += kSize) {
      Four x[N];
      predict_means(run, x);
      if (at_mean.is_definite) correct_means(run, readings, x, squared_distances, log_densities);
      for (int i = 0; i < N; ++i) Lanes::store(x[i], mean_of(i, run));
    }
    return at_mean.is_definite;
  }

  std::size_t num_runs() const { return num_runs_; }
  /// The i-th state of all runs: [num_runs].
  std::span<const double> means(int i) const {
    return {means_.data() + static_cast<std::size_t>(i) * num_padded_, num_runs_};
  }
  /// Of every run.
  const Small<N, N>& covariance() const { return belief_.covariance; }

 private:
  static constexpr std::size_t kSize = 4;
  using Lanes = small_product_detail::Lanes<kSize>;
  using Four = Lanes::Type;

  double* mean_of(int i, std::size_t run) {
    return means_.data() + static_cast<std::size_t>(i) * num_padded_ + run;
  }

  // sum = matrix.row(i) v, or sum += that, by even and odd terms apart.
  template <bool kContinues, int Columns, class Matrix>
  static void add_row(const Matrix& matrix, int i, const Four (&v)[Columns], Four& sum) {
    Four others = matrix(i, 1) * v[1];
    if (kContinues) {
      sum += matrix(i, 0) * v[0];
    } else {
      sum = matrix(i, 0) * v[0];
    }
    for (int k = 2; k < Columns; k += 2) {
      sum += matrix(i, k) * v[k];
      others += matrix(i, k + 1) * v[k + 1];
    }
    sum += others;
  }

  void predict_means(std::size_t run, Four (&predicted)[N]) {
    Four x[N];
    for (int i = 0; i < N; ++i) Lanes::load(mean_of(i, run), x[i]);
    for (int i = 0; i < N; ++i) add_row<false>(F_, i, x, predicted[i]);
  }

  void correct_means(std::size_t run, std::span<const double> readings, Four (&x)[N],
                     std::span<double> squared_distances, std::span<double> log_densities) {
    const std::size_t count = std::min(kSize, num_runs_ - run);
    Four innovation[L], h;
    for (int row = 0; row < L; ++row) {
      const double* const y = readings.data() + static_cast<std::size_t>(row) * num_runs_ + run;
      if (count == kSize) {
        Lanes::load(y, innovation[row]);
      } else {
        innovation[row] = Four{};
        for (std::size_t lane = 0; lane < count; ++lane) innovation[row][lane] = y[lane];
      }
      add_row<false>(H_, row, x, h);
      innovation[row] -= h;
    }
    for (int i = 0; i < N; ++i) add_row<true>(update_.gain(), i, innovation, x[i]);

    // L^-1 nu, in place.
    Four squared_distance = {};
    for (int j = 0; j < L; ++j) {
      for (int i = j + 1; i < L; ++i) innovation[i] -= update_.factor().lower(i, j) * innovation[j];
      squared_distance += innovation[j] * innovation[j] * update_.factor().reciprocals()[j];
    }
    for (std::size_t lane = 0; lane < count; ++lane) {
      squared_distances[run + lane] = squared_distance[lane];
      log_densities[run + lane] = update_.log_density(squared_distance[lane]);
    }
  }

  std::size_t num_runs_, num_padded_;
  Small<N, N> F_, Q_, cross_;
  Small<L, N> H_;
  Small<L, L> R_;
  Belief<N> belief_, predicted_;
  Observation<N, L> observation_;
  ReadingBelief<L> reading_;
  GaussianUpdate<N, L> update_;
  std::vector<double> means_;  // [N x num_padded]
};

}  // namespace holdfast
