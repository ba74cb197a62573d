#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "tools/log_trace.h"
#include "tools/report/figure.h"
#include "tools/scenario_facts.h"

namespace holdfast {

/// More curves cannot be told apart in one figure.
inline constexpr std::size_t kCurvesMax = 8;

/// An estimator that figures show.
struct ShownEstimator {
  std::string name;  // printable
  const EstimatorTrace* trace;
  const EstimatorReview* review;
};

/// What the figures of one log have in common.
struct FigureContext {
  const RunReview& review;
  const ScenarioFacts& facts;
  const LogTrace& trace;
  std::vector<ShownEstimator> estimators;
  std::string step_label;
  std::vector<FigureSpan> spans;
  std::string note;  // on what the spans are
};

/// Estimators beyond the first eight are left out, which the note says.
FigureContext figure_context(const ReviewedLog& log);

/// A figure over the steps, attacks shaded.
Figure step_figure(const FigureContext& context, const std::string& name, const std::string& title,
                   const std::string& y_label);

/// Adds a point; a step that follows with a gap breaks the line.
void add_step(FigureSeries& series, std::int64_t step, double value);

/// Text as a part of a figure's name: lower-case letters, digits and '_'.
std::string figure_name(const std::string& text);

/// Consecutive attacked steps as intervals that reach half a step beyond both ends, the longest
/// ones when they are too many to tell apart; `note` says what was left out.
std::vector<FigureSpan> attack_spans(const std::vector<double>& is_attacked, std::string& note);

}  // namespace holdfast
