#include "tools/review_estimate_figures.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>

#include "tools/experiment.h"
#include "tools/printable_text.h"

namespace holdfast {
namespace {

constexpr std::size_t kStatesMax = 12, kModesMax = 8, kInnovationRowsMax = 4, kChannelsMax = 6;
constexpr double kBandSigmas = 3.0;

// sqrt of a diagonal element of a covariance written row by row; NaN when it is none.
double sigma_of(const std::vector<double>& covariance, std::size_t row, std::size_t size) {
  if (covariance.size() != size * size) return std::nan("");
  return std::sqrt(covariance[row * size + row]);
}

void add_banded(FigureSeries& series, std::int64_t step, double value, double half_width) {
  const std::size_t num_before = series.x.size();
  add_step(series, step, value);
  // A gap adds a point of its own.
  series.low.resize(series.x.size() - 1, std::nan(""));
  series.high.resize(series.x.size() - 1, std::nan(""));
  if (series.x.size() == num_before) return;
  series.low.push_back(value - half_width);
  series.high.push_back(value + half_width);
}

void drop_empty_band(FigureSeries& series) {
  if (std::ranges::any_of(series.low, [](double value) { return std::isfinite(value); })) return;
  series.low.clear();
  series.high.clear();
}

FigureSeries estimate_series(const ShownEstimator& estimator, std::size_t state) {
  FigureSeries series;
  series.name = estimator.name;
  for (const auto& [step, sample] : estimator.trace->samples) {
    if (state >= sample.mean.size()) continue;
    const double sigma = sigma_of(sample.covariance, state, sample.mean.size());
    add_banded(series, step, sample.mean[state], kBandSigmas * sigma);
  }
  drop_empty_band(series);
  return series;
}

std::size_t num_states(const FigureContext& context) {
  std::size_t count = 0;
  for (const auto& [step, truth] : context.trace.truth) count = std::max(count, truth.state.size());
  if (count > 0) return count;
  for (const ShownEstimator& estimator : context.estimators) {
    for (const auto& [step, sample] : estimator.trace->samples)
      count = std::max(count, sample.mean.size());
  }
  return count;
}

// Norm of the error over the states of a group; NaN when the estimate does not hold them.
double error_norm(const StateGroup& group, const std::vector<double>& mean,
                  const std::vector<double>& truth) {
  double sum = 0.0;
  for (const int state : group.states) {
    const auto s = static_cast<std::size_t>(state);
    if (s >= std::min(mean.size(), truth.size())) return std::nan("");
    sum += (mean[s] - truth[s]) * (mean[s] - truth[s]);
  }
  return std::sqrt(sum);
}

std::string mode_name(const FigureContext& context, const ShownEstimator& estimator,
                      std::size_t mode) {
  const auto& experiment = context.facts.experiment;
  const EstimatorEntry* entry =
      experiment == nullptr ? nullptr : experiment->find_estimator(estimator.review->name);
  if (entry != nullptr && mode < entry->mode_names.size()) return "mode " + entry->mode_names[mode];
  return "mode " + std::to_string(mode);
}

void add_mode_figure(const FigureContext& context, const ShownEstimator& estimator,
                     std::vector<Figure>& figures) {
  std::size_t num_modes = 0;
  for (const auto& [step, sample] : estimator.trace->samples)
    num_modes = std::max(num_modes, sample.mode_probability.size());
  if (num_modes == 0) return;
  Figure figure = step_figure(context, "mode_probability_" + figure_name(estimator.name),
                              "Mode probabilities of " + estimator.name, "probability");
  for (std::size_t mode = 0; mode < std::min(num_modes, kModesMax); ++mode) {
    FigureSeries series;
    series.name = mode_name(context, estimator, mode);
    for (const auto& [step, sample] : estimator.trace->samples) {
      if (mode < sample.mode_probability.size())
        add_step(series, step, sample.mode_probability[mode]);
    }
    figure.series.push_back(std::move(series));
  }
  if (num_modes > kModesMax)
    figure.note += " The first " + std::to_string(kModesMax) + " of " + std::to_string(num_modes) +
                   " modes are shown.";
  figures.push_back(std::move(figure));
}

void add_innovation_figures(const FigureContext& context, const ShownEstimator& estimator,
                            std::vector<Figure>& figures) {
  std::size_t num_rows = 0;
  for (const auto& [step, sample] : estimator.trace->samples)
    num_rows = std::max(num_rows, sample.innovation.size());
  for (std::size_t row = 0; row < std::min(num_rows, kInnovationRowsMax); ++row) {
    const std::string number = std::to_string(row);
    Figure figure = step_figure(context, "innovation_" + figure_name(estimator.name) + '_' + number,
                                "Innovation of " + estimator.name + ", row " + number,
                                "innovation [unit of the reading]");
    FigureSeries innovation, threshold;
    innovation.name = "innovation";
    threshold.name = "0 and 3 sigma around it";
    threshold.is_dashed = true;
    for (const auto& [step, sample] : estimator.trace->samples) {
      if (row >= sample.innovation.size()) continue;
      add_step(innovation, step, sample.innovation[row]);
      const double sigma = sigma_of(sample.innovation_covariance, row, sample.innovation.size());
      if (std::isfinite(sigma)) add_banded(threshold, step, 0.0, kBandSigmas * sigma);
    }
    figure.series.push_back(std::move(innovation));
    if (!threshold.x.empty()) {
      figure.note += " Threshold: 3 sqrt(S_ii) of the innovation's own covariance S.";
      figure.series.push_back(std::move(threshold));
    }
    if (row == 0 && num_rows > kInnovationRowsMax)
      figure.note += " The first " + std::to_string(kInnovationRowsMax) + " of " +
                     std::to_string(num_rows) + " rows have a figure.";
    figures.push_back(std::move(figure));
  }
}

// True when a linear axis would show nothing but the largest value.
bool spans_decades(const std::vector<double>& values) {
  constexpr double kRatio = 1e3;
  double low = std::numeric_limits<double>::infinity(), high = 0.0;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  return low > 0.0 && high > kRatio * low;
}

// NIS or NEES with the band that an honest filter keeps to.
void add_consistency_figure(const FigureContext& context, const ShownEstimator& estimator,
                            const std::string& name, const std::string& title,
                            std::vector<Figure>& figures) {
  const auto& curves = estimator.review->metrics.curves;
  const auto is_it = [&name](const MetricCurve& curve) { return curve.name == name; };
  const auto curve = std::ranges::find_if(curves, is_it);
  if (curve == curves.end()) return;
  Figure figure = step_figure(context, name + '_' + figure_name(estimator.name),
                              title + " of " + estimator.name, title);
  FigureSeries series, low, high;
  series.name = title;
  low.name = "lower chi-square threshold";
  high.name = "upper chi-square threshold";
  low.is_dashed = high.is_dashed = true;
  for (std::size_t k = 0; k < curve->value.size(); ++k) {
    const auto step = static_cast<std::int64_t>(k) + 1;
    add_step(series, step, curve->value[k]);
    if (k >= curve->low.size() || k >= curve->high.size()) continue;
    add_step(low, step, curve->low[k]);
    add_step(high, step, curve->high[k]);
  }
  figure.has_log_y = spans_decades(curve->value);
  figure.series = {std::move(series)};
  if (!low.x.empty()) {
    figure.series.push_back(std::move(low));
    figure.series.push_back(std::move(high));
    char text[100];
    std::snprintf(text, sizeof text,
                  " An honest filter lies between the thresholds in %g %% of "
                  "the steps.",
                  100.0 * context.review.metrics_options.band_probability);
    figure.note += text;
  }
  figures.push_back(std::move(figure));
}

// One figure for each channel of the attack signal that an estimator has an estimate of.
void add_signal_figures(const FigureContext& context, std::vector<Figure>& figures) {
  std::size_t num_channels = 0;
  for (const ShownEstimator& estimator : context.estimators) {
    for (const auto& [step, sample] : estimator.trace->samples)
      num_channels = std::max(num_channels, sample.input_mean.size());
  }
  for (std::size_t channel = 0; channel < std::min(num_channels, kChannelsMax); ++channel) {
    const std::string number = std::to_string(channel + 1);
    Figure figure =
        step_figure(context, "attack_signal_" + number, "Attack signal " + number, "attack signal");
    FigureSeries truth;
    truth.name = "truth";
    for (const auto& [step, signal] : context.trace.attack_signals) {
      if (signal.size() == num_channels) add_step(truth, step, signal[channel]);
    }
    if (!truth.x.empty()) figure.series.push_back(std::move(truth));
    for (const ShownEstimator& estimator : context.estimators) {
      FigureSeries series;
      series.name = estimator.name;
      for (const auto& [step, sample] : estimator.trace->samples) {
        if (channel < sample.input_mean.size() && sample.input_step > 0)
          add_step(series, sample.input_step, sample.input_mean[channel]);
      }
      if (!series.x.empty()) figure.series.push_back(std::move(series));
    }
    if (channel == 0 && num_channels > kChannelsMax)
      figure.note += " The first " + std::to_string(kChannelsMax) + " of " +
                     std::to_string(num_channels) + " channels have a figure.";
    figures.push_back(std::move(figure));
  }
}

}  // namespace

std::vector<Figure> state_figures(const FigureContext& context) {
  std::vector<Figure> figures;
  const std::size_t count = num_states(context);
  for (std::size_t state = 0; state < std::min(count, kStatesMax); ++state) {
    const std::string label = printable(state_label(context.facts, static_cast<int>(state)), 60);
    const std::string title = label.substr(0, label.find(" ["));
    Figure figure = step_figure(
        context, "state_" + std::to_string(state) + '_' + figure_name(title), title, label);
    FigureSeries truth;
    truth.name = "truth";
    for (const auto& [step, sample] : context.trace.truth) {
      if (state < sample.state.size()) add_step(truth, step, sample.state[state]);
    }
    if (!truth.x.empty()) figure.series.push_back(std::move(truth));
    bool has_band = false;
    for (const ShownEstimator& estimator : context.estimators) {
      FigureSeries series = estimate_series(estimator, state);
      has_band = has_band || !series.low.empty();
      if (!series.x.empty()) figure.series.push_back(std::move(series));
    }
    if (has_band) figure.note = "Bands: estimate ± 3 standard deviations. " + figure.note;
    if (state == 0 && count > kStatesMax)
      figure.note += " The first " + std::to_string(kStatesMax) + " of " + std::to_string(count) +
                     " states have a figure.";
    figures.push_back(std::move(figure));
  }
  return figures;
}

std::vector<Figure> error_figures(const FigureContext& context) {
  std::vector<Figure> figures;
  for (const StateGroup& group : context.facts.groups) {
    const std::string name = printable(group.name, 40);
    Figure figure = step_figure(
        context, "error_" + figure_name(name), "Error of " + name,
        "error norm" + (group.unit.empty() ? "" : " [" + printable(group.unit, 20) + "]"));
    for (const ShownEstimator& estimator : context.estimators) {
      FigureSeries series;
      series.name = estimator.name;
      for (const auto& [step, sample] : estimator.trace->samples) {
        const auto truth = context.trace.truth.find(step);
        if (truth == context.trace.truth.end()) continue;
        const double error = error_norm(group, sample.mean, truth->second.state);
        if (std::isfinite(error)) add_step(series, step, error);
      }
      if (!series.x.empty()) figure.series.push_back(std::move(series));
    }
    if (group.lost_above > 0.0) figure.levels.push_back({group.lost_above, "lost above"});
    if (!figure.series.empty()) figures.push_back(std::move(figure));
  }
  return figures;
}

std::vector<Figure> attack_figures(const FigureContext& context) {
  std::vector<Figure> figures;
  Figure figure = step_figure(context, "attack_probability", "Attack probability", "probability");
  for (const ShownEstimator& estimator : context.estimators) {
    FigureSeries series;
    series.name = estimator.name;
    for (const auto& [step, sample] : estimator.trace->samples) {
      if (sample.attack_probability >= 0.0 && sample.attack_probability <= 1.0)
        add_step(series, step, sample.attack_probability);
    }
    if (!series.x.empty()) figure.series.push_back(std::move(series));
  }
  if (!figure.series.empty()) {
    figure.levels.push_back(
        {context.review.metrics_options.detection_threshold, "called an attack"});
    figures.push_back(std::move(figure));
  }
  add_signal_figures(context, figures);
  for (const ShownEstimator& estimator : context.estimators)
    add_mode_figure(context, estimator, figures);
  return figures;
}

std::vector<Figure> innovation_figures(const FigureContext& context) {
  std::vector<Figure> figures;
  for (const ShownEstimator& estimator : context.estimators) {
    add_innovation_figures(context, estimator, figures);
    add_consistency_figure(context, estimator, "nis", "NIS", figures);
    add_consistency_figure(context, estimator, "nees", "NEES", figures);
  }
  return figures;
}

}  // namespace holdfast
