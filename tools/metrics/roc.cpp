#include "tools/metrics/roc.h"

#include <algorithm>
#include <cmath>

namespace holdfast {
namespace {

constexpr std::size_t kNumPointsMax = 500;
constexpr std::size_t kNumCells = kNumPointsMax - 2;

// Positives and negatives; of one level, that is one score, or of all.
struct Counts {
  std::int64_t positives = 0, negatives = 0;
};

Counts total_of(const std::vector<Counts>& levels) {
  Counts total;
  for (const Counts& level : levels) {
    total.positives += level.positives;
    total.negatives += level.negatives;
  }
  return total;
}

// The share of pairs in which the positive scores higher, ties one half.
double area_of(const std::vector<Counts>& rising, const Counts& total) {
  double twice = 0.0;  // whole numbers, exact below 2^53
  std::int64_t negatives_below = 0;
  for (const Counts& level : rising) {
    twice += static_cast<double>(level.positives) *
             static_cast<double>(2 * negatives_below + level.negatives);
    negatives_below += level.negatives;
  }
  return twice / 2.0 / static_cast<double>(total.positives) / static_cast<double>(total.negatives);
}

// A long curve keeps the last point of each of equal cells of its length |dx| + |dy|, 2 in all.
RocCurve thinned_curve(const std::vector<Counts>& rising, const Counts& total) {
  RocCurve curve;
  curve.false_alarm_rate = {0.0};
  curve.detection_rate = {0.0};
  std::int64_t alarms = 0, detections = 0;
  const bool is_short = rising.size() < kNumPointsMax;
  std::size_t cell_before = 0;
  bool is_first = true;
  for (std::size_t i = rising.size(); i-- > 0;) {
    if (rising[i].positives == 0 && rising[i].negatives == 0) continue;
    alarms += rising[i].negatives;
    detections += rising[i].positives;
    const double x = static_cast<double>(alarms) / static_cast<double>(total.negatives);
    const double y = static_cast<double>(detections) / static_cast<double>(total.positives);
    const auto cell = std::min(
        static_cast<std::size_t>((x + y) / 2.0 * static_cast<double>(kNumCells)), kNumCells - 1);
    if (!is_short && !is_first && cell == cell_before) {
      curve.false_alarm_rate.back() = x;
      curve.detection_rate.back() = y;
    } else {
      curve.false_alarm_rate.push_back(x);
      curve.detection_rate.push_back(y);
    }
    is_first = false;
    cell_before = cell;
  }
  return curve;
}

// For each level: the share of negatives that one of its positives beats, and of positives that
// beat one of its negatives.
struct Placement {
  double of_positive, of_negative;
};

std::vector<Placement> placements(const std::vector<Counts>& rising, const Counts& total) {
  std::vector<Placement> result(rising.size());
  std::int64_t positives_below = 0, negatives_below = 0;
  for (std::size_t i = 0; i < rising.size(); ++i) {
    const Counts& level = rising[i];
    result[i].of_positive =
        (static_cast<double>(negatives_below) + 0.5 * static_cast<double>(level.negatives)) /
        static_cast<double>(total.negatives);
    result[i].of_negative = (static_cast<double>(total.positives - positives_below) -
                             0.5 * static_cast<double>(level.positives)) /
                            static_cast<double>(total.positives);
    positives_below += level.positives;
    negatives_below += level.negatives;
  }
  return result;
}

// What each run adds to (area - its value), to first order: sum over its positives of
// (placement - area) / positives plus the same over its negatives.
class RunInfluence {
 public:
  RunInfluence(double area, const Counts& total, std::size_t num_runs)
      : area_(area), total_(total), influence_(num_runs, 0.0), has_scores_(num_runs, 0) {}

  void add(std::size_t run, const Placement& placement, const Counts& level) {
    influence_[run] += static_cast<double>(level.positives) * (placement.of_positive - area_) /
                       static_cast<double>(total_.positives);
    influence_[run] += static_cast<double>(level.negatives) * (placement.of_negative - area_) /
                       static_cast<double>(total_.negatives);
    has_scores_[run] = 1;
  }

  double standard_error() const {
    const auto count =
        static_cast<double>(std::count(has_scores_.begin(), has_scores_.end(), char{1}));
    if (count < 2.0) return kNoValue;
    double squares = 0.0;
    for (const double value : influence_) squares += value * value;
    return std::sqrt(squares * count / (count - 1.0));
  }

 private:
  double area_;
  Counts total_;
  std::vector<double> influence_;
  std::vector<char> has_scores_;
};

Roc without_error(const std::vector<Counts>& rising, const Counts& total) {
  Roc roc;
  roc.area.count = total.positives + total.negatives;
  if (total.positives == 0 || total.negatives == 0) return roc;
  roc.curve = thinned_curve(rising, total);
  roc.area.value = roc.curve.area = area_of(rising, total);
  return roc;
}

std::vector<Counts> levels_of(const ScoreHistogram& histogram) {
  std::vector<Counts> levels(ScoreHistogram::kNumBins);
  for (std::size_t i = 0; i < histogram.positives.size(); ++i)
    levels[i] = {histogram.positives[i], histogram.negatives[i]};
  return levels;
}

}  // namespace

Roc roc_of_scores(std::vector<RunScore> scores, std::size_t num_runs) {
  // Ties in the order of runs: an unstable sort's order would reach the last bits of the error.
  std::sort(scores.begin(), scores.end(), [](const RunScore& a, const RunScore& b) {
    if (a.score != b.score) return a.score < b.score;
    if (a.run != b.run) return a.run < b.run;
    return a.is_positive < b.is_positive;
  });
  std::vector<Counts> levels;
  for (std::size_t i = 0; i < scores.size(); ++i) {
    if (i == 0 || scores[i].score != scores[i - 1].score) levels.emplace_back();
    ++(scores[i].is_positive ? levels.back().positives : levels.back().negatives);
  }
  const Counts total = total_of(levels);
  Roc roc = without_error(levels, total);
  if (std::isnan(roc.area.value)) return roc;
  const std::vector<Placement> placement = placements(levels, total);
  RunInfluence influence(roc.area.value, total, num_runs);
  std::size_t level = 0;
  for (std::size_t i = 0; i < scores.size(); ++i) {
    if (i > 0 && scores[i].score != scores[i - 1].score) ++level;
    influence.add(scores[i].run, placement[level],
                  scores[i].is_positive ? Counts{1, 0} : Counts{0, 1});
  }
  roc.area.standard_error = influence.standard_error();
  return roc;
}

Roc roc_of_histogram(const ScoreHistogram& all, std::span<const ScoreHistogram> of_runs) {
  const std::vector<Counts> levels = levels_of(all);
  const Counts total = total_of(levels);
  Roc roc = without_error(levels, total);
  if (std::isnan(roc.area.value) || of_runs.empty()) return roc;
  const std::vector<Placement> placement = placements(levels, total);
  RunInfluence influence(roc.area.value, total, of_runs.size());
  for (std::size_t run = 0; run < of_runs.size(); ++run) {
    const std::vector<Counts> own = levels_of(of_runs[run]);
    for (std::size_t i = 0; i < own.size(); ++i) {
      if (own[i].positives > 0 || own[i].negatives > 0) influence.add(run, placement[i], own[i]);
    }
  }
  roc.area.standard_error = influence.standard_error();
  return roc;
}

}  // namespace holdfast
