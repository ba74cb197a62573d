#pragma once

#include <vector>

#include "tools/review_figure_parts.h"

namespace holdfast {

/// Each state: truth and estimates with bands of 3 sigma.
std::vector<Figure> state_figures(const FigureContext& context);
/// Each state group: norm of the error.
std::vector<Figure> error_figures(const FigureContext& context);
/// Attack probability, and mode probabilities of each estimator that gives them.
std::vector<Figure> attack_figures(const FigureContext& context);
/// Innovations, NIS and NEES with thresholds, of each estimator that gives them.
std::vector<Figure> innovation_figures(const FigureContext& context);

}  // namespace holdfast
