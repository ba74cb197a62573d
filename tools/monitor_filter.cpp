#include "tools/monitor_filter.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "estimators/kalman_core.h"

namespace holdfast {
namespace {

// A start that is known exactly would leave a covariance that no factor has.
constexpr double kStartStdMin = 1e-9;
constexpr std::int64_t kPredictionsMax = 10000;

class MonitorFilter {
 public:
  MonitorFilter(SystemSetup plant, const FrameLayout& layout)
      : plant_(std::move(plant)), core_(plant_.model()) {
    const auto n = static_cast<Eigen::Index>(plant_.model().num_states());
    const SignalAttackPlantOptions& options = plant_.options;
    belief_.mean = Eigen::Map<const Eigen::VectorXd>(options.start_state.data(), n);
    belief_.covariance = Eigen::MatrixXd::Zero(n, n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const double std = std::max(kStartStdMin, options.start_std[static_cast<std::size_t>(i)]);
      belief_.covariance(i, i) = std * std;
    }
    if (options.start_step == 0) core_.predict(belief_);
    for (std::size_t i = 0; i < layout.messages.size(); ++i) {
      const DbcMessage* message = layout.dbc.find(layout.messages[i]);
      Source source{*message, {}, plant_.rows[i]};
      for (const std::string& signal : layout.signals)
        source.signals.push_back(*message->find(signal));
      sources_.push_back(std::move(source));
    }
    take_input();
  }

  double largest_share(const CanFrame& frame, const CanFrame& changed, double residual_most) {
    const Source* source = source_of(frame);
    if (source == nullptr) return 1.0;
    core_.observe(belief_);
    if (!core_.use_rows(source->rows)) return -1.0;
    read(*source, frame, values_);
    read(*source, changed, wished_);
    // The squared residual along the change, s = 0, 1 and -1, is q0 + b s + c s^2.
    const double q0 = core_.innovate(values_), q1 = core_.innovate(wished_);
    for (std::size_t i = 0; i < values_.size(); ++i) wished_[i] = 2.0 * values_[i] - wished_[i];
    const double back = core_.innovate(wished_);
    const double limit = residual_most * residual_most;
    if (q1 <= limit) return 1.0;
    if (!(q0 <= limit)) return -1.0;
    const double c = 0.5 * (q1 + back) - q0, b = 0.5 * (q1 - back);
    return (std::sqrt(std::max(0.0, b * b - 4.0 * c * (q0 - limit))) - b) / (2.0 * c);
  }

  void take(const CanFrame& sent) {
    const Source* source = source_of(sent);
    if (source == nullptr) return;
    read(*source, sent, values_);
    const bool is_finite =
        std::ranges::all_of(values_, [](double value) { return std::isfinite(value); });
    core_.observe(belief_);
    if (!is_finite || !core_.use_rows(source->rows)) return;
    core_.innovate(values_);
    core_.correct(belief_);
  }

  // What lies further back than so many predictions has left nothing in a plant that can be
  // followed, and in another one nothing that helps.
  void begin_at(std::int64_t step) {
    step_ = std::max<std::int64_t>(1, step - kPredictionsMax);
    take_input();
    while (step_ < step) end_step();
  }

  void end_step() {
    core_.predict(belief_);
    if (input_.size() > 0) belief_.mean += plant_.model().B * input_;
    ++step_;
    take_input();
  }

 private:
  struct Source {
    DbcMessage message;
    std::vector<DbcSignal> signals;
    std::vector<int> rows;
  };

  const Source* source_of(const CanFrame& frame) const {
    if (frame.has(CanFrame::kRemote)) return nullptr;
    for (const Source& source : sources_) {
      if (!source.message.matches(frame)) continue;
      const bool fits = std::ranges::all_of(
          source.signals, [&](const DbcSignal& signal) { return signal.fits(frame.num_bytes); });
      return fits ? &source : nullptr;
    }
    return nullptr;
  }

  // What is known to act on the readings is taken off, so that the filter's h(x) remains.
  void read(const Source& source, const CanFrame& frame, std::vector<double>& values) const {
    values.clear();
    for (std::size_t i = 0; i < source.signals.size(); ++i) {
      const double known = offset_.size() > 0 ? offset_[source.rows[i]] : 0.0;
      values.push_back(source.signals[i].unpack(frame.bytes()) - known);
    }
  }

  void take_input() {
    if (plant_.model().num_inputs() == 0) return;
    input_ = plant_.options.input(step_, plant_.model());
    offset_ = plant_.model().D * input_;
  }

  SystemSetup plant_;
  KalmanCore core_;
  Gaussian belief_;
  std::vector<Source> sources_;
  std::vector<double> values_, wished_;
  Eigen::VectorXd input_, offset_;
  std::int64_t step_ = 1;
};

}  // namespace

MonitorModel make_monitor_model(const SystemSetup& plant, const FrameLayout& layout) {
  const auto filter = std::make_shared<MonitorFilter>(plant, layout);
  return {[filter](const CanFrame& frame, const CanFrame& changed, double residual_most) {
            return filter->largest_share(frame, changed, residual_most);
          },
          [filter](const CanFrame& sent) { filter->take(sent); }, [filter] { filter->end_step(); },
          [filter](std::int64_t step) { filter->begin_at(step); }};
}

}  // namespace holdfast
