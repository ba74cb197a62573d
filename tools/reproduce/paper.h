#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace holdfast {

/// One campaign of a paper's figures and tables.
struct PaperCampaign {
  std::string name, scenario;                           // scenario: file, as it stands
  std::vector<std::string> settings;                    // "key=value"
  std::string sweep_key;                                // empty: no sweep
  std::vector<std::string> sweep_values, sweep_labels;  // labels: of the values, in tables
  std::int64_t runs = 400, runs_max = 400, quick_runs = 40;
};

/// One number to compare.
struct PaperRow {
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

  std::string campaign, estimator, group, metric = "rmse_step_mean", label;
  std::int64_t point = 0;                            // of the campaign's sweep
  double paper = kNone;                              // as printed in the paper, where it prints it
  double reference = kNone, standard_error = kNone;  // of the independent implementation
  // Where only the range of the reference is known: the end that is nearer to our value, or that
  // value itself where it lies between.
  double lowest = kNone, highest = kNone;
  std::int64_t reference_runs = 0;  // where no standard error is stated: ours, for that many runs
  // Widest band that still tells something; none: a tenth of the reference. Where that is 0 or its
  // error large, an absolute one says what matters.
  double band_max = kNone;
  bool is_control = false;  // wrong on purpose: must differ
};

/// Rows under one title.
struct PaperTable {
  std::string name, title;
  std::string chosen_by_us;  // what the paper does not state; empty: nothing
  std::vector<PaperRow> rows;
};

/// One figure. kCurve: a metric's curve over the steps; kSweep: a metric over a sweep's values; the
/// others show one run: kPath two states against each other, kReadings what sources sent, kStates,
/// kAttack and kModes states, attack signals and modes with their estimates, kPackets how many
/// arrived.
struct PaperFigure {
  enum class Kind { kCurve, kSweep, kPath, kReadings, kStates, kAttack, kModes, kPackets };

  std::string name, title, campaign, metric, group, x_label, y_label;
  std::vector<std::string> estimators;  // empty: all
  std::vector<std::int64_t> sources;    // of kReadings; which states, channels or modes of others
  Kind kind = Kind::kCurve;
  std::int64_t run = 0;  // of a single run
};

/// A published method's figures and tables, as scenarios/papers/NAME.yaml says them.
struct Paper {
  std::string name, title, chosen_by_us;
  std::vector<PaperCampaign> campaigns;
  std::vector<PaperTable> tables;
  std::vector<PaperFigure> figures;
  std::vector<PaperTable> choices;  // sweeps over what was chosen by us: shown, not judged

  const PaperCampaign& campaign(const std::string& campaign_name) const;  // throws UsageError
};

/// Reads a paper's file. Throws ConfigurationError with every problem.
Paper load_paper(const std::string& file);

/// Leaves only the table or figure of this name, and the campaigns that it needs. Throws
/// UsageError, which lists the names, when there is none.
Paper only(const Paper& paper, const std::string& name);

}  // namespace holdfast
