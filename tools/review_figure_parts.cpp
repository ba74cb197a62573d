#include "tools/review_figure_parts.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "tools/printable_text.h"

namespace holdfast {
namespace {

constexpr std::size_t kSpansMax = 100;  // more intervals cannot be told apart in one figure

std::string step_label(double step_s) {
  if (!(step_s > 0.0)) return "step";
  char text[64];
  std::snprintf(text, sizeof text, "step (1 step = %.6g s)", step_s);
  return text;
}

}  // namespace

FigureContext figure_context(const ReviewedLog& log) {
  FigureContext context{log.review, *log.facts, *log.trace, {}, step_label(log.facts->step_s),
                        {},         ""};
  context.spans = attack_spans(log.review.is_attacked, context.note);
  std::size_t num_left_out = 0;
  for (const EstimatorReview& estimator : log.review.estimators) {
    const auto found = log.trace->estimators.find(estimator.trace_key);
    if (found == log.trace->estimators.end() || found->second.samples.empty()) continue;
    if (context.estimators.size() == kCurvesMax) {
      ++num_left_out;
      continue;
    }
    context.estimators.push_back({printable(estimator.name, 40), &found->second, &estimator});
  }
  if (num_left_out > 0)
    context.note += " " + std::to_string(num_left_out) + " further estimators are not drawn.";
  return context;
}

Figure step_figure(const FigureContext& context, const std::string& name, const std::string& title,
                   const std::string& y_label) {
  Figure figure;
  figure.name = name;
  figure.title = title;
  figure.x_label = context.step_label;
  figure.y_label = y_label;
  figure.spans = context.spans;
  figure.note = context.note;
  return figure;
}

void add_step(FigureSeries& series, std::int64_t step, double value) {
  const auto x = static_cast<double>(step);
  if (!series.x.empty() && x > series.x.back() + 1.0) {
    series.x.push_back(series.x.back() + 1.0);
    series.y.push_back(std::nan(""));
  }
  series.x.push_back(x);
  series.y.push_back(value);
}

std::string figure_name(const std::string& text) {
  std::string name;
  for (const char c : text.substr(0, 60)) {
    const bool is_upper = c >= 'A' && c <= 'Z';
    const bool is_kept = is_upper || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9');
    name += !is_kept ? '_' : is_upper ? static_cast<char>(c - 'A' + 'a') : c;
  }
  return name;
}

std::vector<FigureSpan> attack_spans(const std::vector<double>& is_attacked, std::string& note) {
  std::vector<FigureSpan> spans;
  std::size_t num_attacked = 0;
  for (std::size_t k = 0; k < is_attacked.size(); ++k) {
    if (is_attacked[k] < 0.5) continue;
    ++num_attacked;
    const auto step = static_cast<double>(k + 1);
    if (!spans.empty() && spans.back().to == step - 0.5) {
      spans.back().to = step + 0.5;
    } else {
      spans.push_back({step - 0.5, step + 0.5, "attacked"});
    }
  }
  if (spans.empty()) return spans;
  note = "Shaded: attacked steps, " + std::to_string(num_attacked) + " of " +
         std::to_string(is_attacked.size()) + ".";
  if (spans.size() <= kSpansMax) return spans;
  note += " They lie in " + std::to_string(spans.size()) + " intervals; the " +
          std::to_string(kSpansMax) + " longest are shaded.";
  std::ranges::stable_sort(spans, std::ranges::greater(),
                           [](const FigureSpan& span) { return span.to - span.from; });
  spans.resize(kSpansMax);
  std::ranges::sort(spans, {}, &FigureSpan::from);
  return spans;
}

}  // namespace holdfast
