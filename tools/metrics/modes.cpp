#include <algorithm>
#include <cmath>

#include "tools/metrics/metric_parts.h"

namespace holdfast {
namespace {

// Changes of the true mode in each run, and what became of them.
struct ModeChanges {
  explicit ModeChanges(std::size_t num_runs)
      : changes(num_runs), found(num_runs), delay(num_runs), start_delay(num_runs, kNoValue) {}

  std::vector<double> changes, found;
  std::vector<double> delay;        // steps, summed over the changes that were found
  std::vector<double> start_delay;  // steps, of the mode of the first step
};

// True when the mode is right in so many steps from row k on, or to the end of the run.
bool is_held(std::span<const double> is_correct, std::size_t k, std::int64_t hold_steps) {
  const auto end = std::min(is_correct.size(), k + static_cast<std::size_t>(hold_steps));
  return std::all_of(is_correct.begin() + static_cast<std::ptrdiff_t>(k),
                     is_correct.begin() + static_cast<std::ptrdiff_t>(end),
                     [](double correct) { return correct > 0.5; });
}

void count_run(std::size_t run, std::span<const double> mode, std::span<const double> is_correct,
               std::int64_t hold_steps, ModeChanges& counts) {
  double known_mode = kNoValue;
  std::size_t changed_at = 0;
  bool is_open = false;  // a change that has not been found yet
  bool is_start = false;
  for (std::size_t k = 0; k < mode.size(); ++k) {
    if (!std::isnan(mode[k])) {
      if (std::isnan(known_mode) || mode[k] != known_mode) {
        is_start = std::isnan(known_mode);
        counts.changes[run] += is_start ? 0.0 : 1.0;
        changed_at = k;
        is_open = true;
      }
      known_mode = mode[k];
    }
    if (!is_open || !is_held(is_correct, k, hold_steps)) continue;
    const auto delay = static_cast<double>(k - changed_at);
    if (is_start) {
      counts.start_delay[run] = delay;
    } else {
      counts.found[run] += 1.0;
      counts.delay[run] += delay;
    }
    is_open = false;
  }
}

}  // namespace

void add_mixtures(const MetricsInput& input, EstimatorMetrics& result) {
  for (const auto& [name, matrix] : input.runs.curves) {
    for (const std::string kind : {"components", "candidates"}) {
      if (!name.starts_with(kind + ".")) continue;
      const std::string hypothesis = name.substr(kind.size() + 1);
      add_metric(result, kind + "_mean", hypothesis, "", mean_of(run_means(matrix)));
      std::vector<double> largest;
      for (std::size_t r = 0; r < matrix.num_runs(); ++r) {
        double most = kNoValue;
        for (const double count : matrix.run(r)) most = std::fmax(most, count);
        largest.push_back(most);
      }
      add_metric(result, kind + "_largest", hypothesis, "", mean_of(largest));
    }
  }
}

void add_modes(const MetricsInput& input, EstimatorMetrics& result) {
  const RunMatrix* is_correct = input.find("mode_correct");
  if (is_correct == nullptr) return;
  add_metric(result, "mode_accuracy", "", "", mean_of(run_means(*is_correct)));
  result.curves.push_back(mean_curve("mode_accuracy", *is_correct));
  const RunMatrix* mode = input.find("mode");
  if (mode == nullptr) return;
  ModeChanges counts(mode->num_runs());
  for (std::size_t r = 0; r < mode->num_runs(); ++r)
    count_run(r, mode->run(r), is_correct->run(r), input.options.mode_hold_steps, counts);
  add_metric(result, "mode_start_delay", "", "steps", mean_of(counts.start_delay));
  add_metric(result, "mode_delay", "", "steps",
             ratio_of(counts.delay, counts.found, input.bootstrap));
  add_metric(result, "mode_changes_found", "", "",
             ratio_of(counts.found, counts.changes, input.bootstrap));
}

}  // namespace holdfast
