#pragma once

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "common/errors.h"
#include "estimators/kalman_core.h"
#include "estimators/site_smoother.h"
#include "estimators/sized_model.h"
#include "estimators/vector_kernel.h"

namespace holdfast {

/// Correction by a reading that is believed to be one Gaussian; kFailed, and the posterior as it
/// was, when its S is not positive definite. y: [l], rows that are missing in the observation are
/// ignored.
template <int N, int L>
VectorResult correct_once(GaussianUpdate<N, L>& update, const Belief<N>& prior,
                          const Observation<N, L>& observation, const ReadingBelief<L>& reading,
                          const Small<L>& y, Belief<N>& posterior) {
  const UpdateResult one = update.weigh(observation, reading, y);
  if (!one.is_definite) return {};
  update.apply(prior, observation, reading, posterior);
  return {VectorResult::Kind::kCorrected, one.squared_distance, one.log_density};
}

/// A VectorKernel in sizes N and L (or Eigen::Dynamic) by a method, a class template that has
///
///   void begin_step(step)                                for parameters that change
///   void believe(observation, R, reading)                the reading as one Gaussian
///   VectorResult correct(prior, observation, reading, model, y, posterior)
///   bool move(model, belief, cross, predicted)           optional: moves more than one belief
///   void publish(estimate)
///   const ReadingBelief* explained()                     optional: the reading as it was explained
///   int num_passes()                                     of the smoother; 1: Rauch-Tung-Striebel
///   begin_pass(), bool tilt(step, observation of s, R, y, tilted s)    where passes may be more
///
/// With a step of several passes the motion must be linear.
template <template <int, int> class Method, int N, int L>
class SizedVectorKernel : public VectorKernel {
 public:
  SizedVectorKernel(const SystemModel& model, Linearisation linearisation, const Gaussian& start,
                    Method<N, L> method)
      : model_(model, linearisation),
        belief_{start.mean, start.covariance},
        method_(std::move(method)),
        is_linear_(model.is_linear()) {
    observed_.h.resize(model.num_measurements());
    y_.resize(model.num_measurements());
    now_.smoothing.cross.setZero(model.num_states(), model.num_states());
  }

  void begin_step(std::int64_t step, bool has_to_move) override {
    method_.begin_step(step);
    now_.step = step;
    now_.has_reading = false;
    if (!has_to_move) {
      now_.smoothing.predicted = belief_;
    } else if (!moves_itself()) {
      model_.predict(belief_, now_.smoothing.cross, now_.smoothing.predicted);
    }
    belief_ = now_.smoothing.predicted;
  }

  void observe() override { model_.observe(now_.smoothing.predicted, observed_); }

  double distance(std::span<const int> rows, std::span<const double> values) override {
    const Observation<N, L>& observation = take(rows, values);
    method_.believe(observation, model_.R(), reading_);
    const UpdateResult result = update_.weigh(observation, reading_, y_);
    return result.is_definite ? result.squared_distance : std::numeric_limits<double>::infinity();
  }

  VectorResult correct(std::span<const int> rows, std::span<const double> values) override {
    if (!std::ranges::equal(rows_, rows)) rows_.assign(rows.begin(), rows.end());
    const Observation<N, L>& observation = take(rows, values);
    method_.believe(observation, model_.R(), reading_);
    if (num_kept_max_ > 0) {
      now_.has_reading = true;
      now_.y = y_;
      now_.num_missing = observation.num_missing;
      now_.is_missing = observation.is_missing;
    }
    const VectorResult result =
        method_.correct(now_.smoothing.predicted, observation, reading_, model_, y_, belief_);
    if constexpr (requires(const Method<N, L>& m) { m.explained(); }) {
      if (const ReadingBelief<L>* explained = method_.explained()) reading_ = *explained;
    }
    return result;
  }

  void end_step() override {
    if (num_kept_max_ == 0) return;
    now_.smoothing.filtered = belief_;
    if (kept_.size() < num_kept_max_) {
      kept_.push_back(now_);
    } else {
      kept_[first_kept_] = now_;
      first_kept_ = (first_kept_ + 1) % kept_.size();
    }
  }

  void publish(Estimate& estimate) const override {
    estimate.mean = belief_.mean;
    estimate.covariance = belief_.covariance;
    method_.publish(estimate);
  }

  void publish_innovation(Eigen::VectorXd& nu, Eigen::MatrixXd& S) const override {
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      const auto row = static_cast<Eigen::Index>(i);
      nu[row] = y_[rows_[i]] - reading_.mean[rows_[i]];
      for (std::size_t j = 0; j < rows_.size(); ++j) {
        S(row, static_cast<Eigen::Index>(j)) = reading_.S(rows_[i], rows_[j]);
      }
    }
  }

  void remember(std::size_t num_steps) override {
    num_kept_max_ = num_steps;
    first_kept_ = 0;
    kept_.clear();
    // A window of known length is reserved, so that steps allocate nothing; a whole run grows.
    if (num_steps < 100'000) kept_.reserve(num_steps);
  }

  void smooth() override {
    const auto step_at = [this](std::size_t i) -> const SmoothingStep<N>& {
      return kept(i).smoothing;
    };
    if constexpr (requires(Method<N, L> & m) { m.num_passes(); }) {
      if (method_.num_passes() > 1 && is_linear_) return smooth_by_sites(step_at);
    }
    smooth_interval<N>(kept_.size(), step_at, smoothed_);
  }

  void publish_smoothed(std::size_t i, Estimate& estimate) const override {
    estimate.mean = smoothed_[i].mean;
    estimate.covariance = smoothed_[i].covariance;
  }

 private:
  struct Kept {
    std::int64_t step = 0;
    SmoothingStep<N> smoothing;
    bool has_reading = false;
    Small<L> y;
    int num_missing = 0;
    std::array<bool, small_bound(L)> is_missing{};
  };

  // True when the method has moved what it holds instead of one belief.
  bool moves_itself() {
    if constexpr (requires(Method<N, L> & m) {
                    m.move(model_, belief_, now_.smoothing.cross, now_.smoothing.predicted);
                  }) {
      return method_.move(model_, belief_, now_.smoothing.cross, now_.smoothing.predicted);
    }
    return false;
  }

  const Kept& kept(std::size_t i) const { return kept_[(first_kept_ + i) % kept_.size()]; }

  // All rows in their order, as they mostly come.
  bool is_whole_vector(std::span<const int> rows) const {
    if (static_cast<Eigen::Index>(rows.size()) != y_.size()) return false;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (rows[i] != static_cast<int>(i)) return false;
    }
    return true;
  }

  // Sets y, and the observation of the rows that arrived.
  const Observation<N, L>& take(std::span<const int> rows, std::span<const double> values) {
    const Eigen::Index l = y_.size();
    if (is_whole_vector(rows)) {
      y_ = Eigen::Map<const Small<L>>(values.data(), l);
      return observed_;
    }
    for (std::size_t i = 0; i < rows.size(); ++i) y_[rows[i]] = values[i];
    if (static_cast<Eigen::Index>(rows.size()) == l) return observed_;
    used_ = observed_;
    for (int row = 0; row < static_cast<int>(l); ++row) {
      if (std::find(rows.begin(), rows.end(), row) != rows.end()) continue;
      y_[row] = 0.0;
      used_.leave_out(row);
    }
    return used_;
  }

  template <class StepAt>
  void smooth_by_sites(const StepAt& step_at) {
    Observation<L, L> of_s;
    const auto tilt = [&](std::size_t i, const Belief<L>& cavity, Belief<L>& tilted) {
      const Kept& it = kept(i);
      if (!it.has_reading) return false;
      const auto l = cavity.mean.size();
      of_s.expect_all();
      observe_linear<L, L>(Small<L, L>::Identity(l, l), cavity, of_s);
      for (Eigen::Index row = 0; row < l && it.num_missing > 0; ++row) {
        if (it.is_missing[static_cast<std::size_t>(row)]) of_s.leave_out(row);
      }
      return method_.tilt(it.step, cavity, of_s, model_.R(), it.y, tilted);
    };
    const auto begin_pass = [this] { method_.begin_pass(); };
    sites_.smooth(model_, kept_.size(), method_.num_passes(), step_at, begin_pass, tilt, smoothed_);
  }

  SizedModel<N, L> model_;
  Belief<N> belief_;
  Method<N, L> method_;
  bool is_linear_;
  Observation<N, L> observed_, used_;
  Small<L> y_;
  std::vector<int> rows_;
  ReadingBelief<L> reading_;
  GaussianUpdate<N, L> update_;

  Kept now_;
  std::vector<Kept> kept_;
  std::size_t num_kept_max_ = 0, first_kept_ = 0;
  std::vector<Belief<N>> smoothed_;
  SiteSmoother<N, L> sites_;
};

/// Sizes that a kernel is compiled for.
template <int NumStates, int NumMeasurements>
struct KnownSizes {
  static constexpr int kN = NumStates, kL = NumMeasurements;
};

/// The kernel in the sizes of the model, if they are among the known ones, else of any. Throws
/// UsageError for a model with problems() or of more than kSmallSizeMax states or measurements.
template <template <int, int> class Method, class... Known, class MakeMethod>
std::unique_ptr<VectorKernel> make_vector_kernel(const SystemModel& model,
                                                 Linearisation linearisation, const Gaussian& start,
                                                 const MakeMethod& make_method) {
  const std::vector<std::string> problems = model.problems();
  if (!problems.empty()) throw UsageError("model: " + problems.front());
  const int n = model.num_states(), l = model.num_measurements();
  if (n > kSmallSizeMax || l > kSmallSizeMax) {
    throw UsageError("this method takes at most " + std::to_string(kSmallSizeMax) +
                     " states and as many measurements");
  }
  const auto make = [&]<int N, int L>() -> std::unique_ptr<VectorKernel> {
    return std::make_unique<SizedVectorKernel<Method, N, L>>(
        model, linearisation, start, make_method.template operator()<N, L>());
  };
  std::unique_ptr<VectorKernel> kernel;
  const auto try_known = [&]<class Sizes>(Sizes) {
    if (n == Sizes::kN && l == Sizes::kL) kernel = make.template operator()<Sizes::kN, Sizes::kL>();
  };
  (try_known(Known()), ...);
  if (kernel == nullptr) kernel = make.template operator()<Eigen::Dynamic, Eigen::Dynamic>();
  return kernel;
}

}  // namespace holdfast
