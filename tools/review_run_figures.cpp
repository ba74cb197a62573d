#include "tools/review_run_figures.h"

#include <algorithm>
#include <cmath>
#include <holdfast/attack_frame_t.hpp>
#include <limits>
#include <map>
#include <string>

#include "tools/printable_text.h"

namespace holdfast {
namespace {

constexpr std::size_t kQuantiles = 200;  // points of a distribution's curve

FigureSeries points(const std::string& name) {
  FigureSeries series;
  series.name = name;
  series.style = FigureSeries::Style::kPoints;
  return series;
}

void add_marks(const FigureContext& context, std::int32_t disposition, const std::string& name,
               Figure& figure) {
  FigureSeries series = points(name);
  for (const FrameMark& mark : context.trace.touched) {
    if (mark.disposition != disposition) continue;
    series.x.push_back(static_cast<double>(mark.step));
    series.y.push_back(mark.identifier);
  }
  if (!series.x.empty()) figure.series.push_back(std::move(series));
}

void add_foreign_marks(const FigureContext& context, Figure& figure) {
  if (!context.review.frames.has_sent) return;
  FigureSeries series = points("foreign");
  for (const FrameMark& mark : context.trace.received) {
    if (context.review.frames.find(mark.rx_index).label != PacketLabel::kForeign) continue;
    series.x.push_back(static_cast<double>(mark.step));
    series.y.push_back(mark.identifier);
  }
  if (!series.x.empty()) figure.series.push_back(std::move(series));
}

FigureSeries count_series(const std::string& name, const std::map<std::int64_t, double>& counts) {
  FigureSeries series;
  series.name = name;
  series.style = FigureSeries::Style::kSteps;
  for (const auto& [step, count] : counts) add_step(series, step, count);
  return series;
}

// Packets that reached the estimators at each step, and those of them that are not authentic.
Figure packet_figure(const FigureContext& context) {
  Figure figure = step_figure(context, "packets", "Packets per step", "packets");
  std::map<std::int64_t, double> received, attacked, dropped;
  for (const std::int64_t step : context.trace.measurement_steps)
    received[step] = attacked[step] = dropped[step] = 0.0;
  const bool has_labels = context.review.frames.has_sent;
  for (const PacketRow& packet : context.review.packets) {
    received[packet.step] += 1.0;
    const PacketLabel label = packet.frame.label;
    if (label != PacketLabel::kAuthentic && label != PacketLabel::kUnknown)
      attacked[packet.step] += 1.0;
  }
  for (const FrameMark& mark : context.trace.touched) {
    // One that is held is missing in its step, whatever becomes of it.
    if (mark.disposition == attack_frame_t::DROPPED || mark.disposition == attack_frame_t::HELD) {
      dropped[mark.step] += 1.0;
    } else if (!has_labels) {
      attacked[mark.step] += 1.0;
    }
  }
  if (received.empty()) return figure;
  figure.series.push_back(count_series("received", received));
  const auto acts = [](const auto& entry) { return entry.second > 0.0; };
  if (std::ranges::any_of(attacked, acts)) {
    figure.series.push_back(
        count_series(has_labels ? "attacked" : "altered or injected", attacked));
  }
  if (std::ranges::any_of(dropped, acts))
    figure.series.push_back(count_series("dropped by a rule", dropped));
  return figure;
}

Figure distribution_figure(const FigureContext& context) {
  Figure figure;
  figure.name = "step_time_distribution";
  figure.title = "Distribution of step times";
  figure.x_label = "time of a step [us]";
  figure.y_label = "share of steps that took at most this";
  for (const ShownEstimator& estimator : context.estimators) {
    std::vector<double> times_us;
    for (const StepTime& time : estimator.trace->compute_time) times_us.push_back(time.time_us);
    if (times_us.empty()) continue;
    std::ranges::sort(times_us);
    FigureSeries series;
    series.name = estimator.name;
    series.style = FigureSeries::Style::kSteps;
    const std::size_t count = std::min(kQuantiles, times_us.size());
    for (std::size_t i = 1; i <= count; ++i) {
      const std::size_t rank = i * times_us.size() / count;
      series.x.push_back(times_us[rank - 1]);
      series.y.push_back(static_cast<double>(rank) / static_cast<double>(times_us.size()));
    }
    figure.series.push_back(std::move(series));
  }
  return figure;
}

FigureSeries path_series(const std::string& name, const std::vector<PlotPoint>& path) {
  FigureSeries series;
  series.name = name;
  for (const PlotPoint& point : path) {
    series.x.push_back(point.x);
    series.y.push_back(point.y);
  }
  return series;
}

}  // namespace

std::vector<Figure> frame_figures(const FigureContext& context) {
  std::vector<Figure> figures;
  Figure marks = step_figure(context, "frames", "Frames that an attack touched", "identifier");
  marks.spans.clear();
  for (std::size_t i = 0; i < AttackRecord::kNumDispositions; ++i) {
    const auto disposition = static_cast<AttackRecord::Disposition>(i);
    add_marks(context, static_cast<std::int32_t>(i), to_string(disposition), marks);
  }
  add_foreign_marks(context, marks);
  marks.note = "Foreign: on the monitor-side bus, but never sent by the attacker's proxy.";
  if (!marks.series.empty()) figures.push_back(std::move(marks));
  Figure packets = packet_figure(context);
  if (!packets.series.empty()) figures.push_back(std::move(packets));
  return figures;
}

std::vector<Figure> loss_figures(const FigureContext& context) {
  Figure figure = step_figure(context, "losses", "Losses", "lost since the start");
  for (const auto& [channel, marks] : context.trace.losses) {
    if (std::ranges::all_of(marks, [](const LossMark& mark) { return mark.count == 0; })) continue;
    FigureSeries series;
    series.name = printable(channel.substr(std::string("STATUS_").size()), 40);
    series.style = FigureSeries::Style::kSteps;
    for (const LossMark& mark : marks) {
      series.x.push_back(static_cast<double>(mark.step));
      series.y.push_back(static_cast<double>(mark.count));
    }
    figure.series.push_back(std::move(series));
    if (figure.series.size() == 8) break;  // more would not be told apart
  }
  if (figure.series.empty()) return {};
  figure.note += " Sum of each process's loss counters, from its status messages.";
  return {figure};
}

std::vector<Figure> time_figures(const FigureContext& context) {
  std::vector<Figure> figures;
  Figure figure = step_figure(context, "step_times", "Time of each step", "time of a step [us]");
  double least_us = std::numeric_limits<double>::infinity(), most_us = 0.0;
  for (const ShownEstimator& estimator : context.estimators) {
    FigureSeries series = points(estimator.name);
    for (const StepTime& time : estimator.trace->compute_time) {
      series.x.push_back(static_cast<double>(time.step));
      series.y.push_back(time.time_us);
      least_us = std::min(least_us, time.time_us);
      most_us = std::max(most_us, time.time_us);
    }
    if (series.x.empty()) continue;
    figure.levels.push_back({estimator.review->compute_time.p50_us, estimator.name + ", p50"});
    figure.levels.push_back({estimator.review->compute_time.p99_us, estimator.name + ", p99"});
    figure.series.push_back(std::move(series));
  }
  if (figure.series.empty()) return figures;
  constexpr double kDecades = 100.0;  // from here on a linear axis shows the longest only
  figure.has_log_y = least_us > 0.0 && most_us > kDecades * least_us;
  figures.push_back(std::move(figure));
  Figure distribution = distribution_figure(context);
  distribution.note = "Cumulated: half of the steps took at most the time at 0.5.";
  figures.push_back(std::move(distribution));
  return figures;
}

std::vector<Figure> path_figures(const FigureContext& context) {
  Figure figure;
  figure.name = "path";
  figure.title = "Path in the plane";
  figure.x_label = printable(context.review.x_label, 60);
  figure.y_label = printable(context.review.y_label, 60);
  figure.has_equal_axes = true;
  if (!context.review.true_path.empty())
    figure.series.push_back(path_series("truth", context.review.true_path));
  for (const ShownEstimator& estimator : context.estimators) {
    if (!estimator.review->path.empty())
      figure.series.push_back(path_series(estimator.name, estimator.review->path));
  }
  if (figure.series.empty()) return {};
  if (!context.review.sensors.empty()) {
    figure.series.push_back(path_series("sensors", context.review.sensors));
    figure.series.back().style = FigureSeries::Style::kPoints;
  }
  return {figure};
}

}  // namespace holdfast
