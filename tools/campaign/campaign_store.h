#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tools/campaign/campaign_plan.h"
#include "tools/campaign/run_result.h"
#include "tools/campaign/sqlite_database.h"

namespace holdfast {

/// One sweep point as a results file knows it.
struct StoredPoint {
  std::vector<std::string> settings;
  std::string scenario;                 // resolved
  std::vector<std::string> estimators;  // in the scenario's order
};

/// Runs of a range; all there are by default.
struct RunRange {
  std::int64_t first = 0, last = (std::int64_t{1} << 31) - 1;
};

/// The results of a campaign in one SQLite file; its tables are described in docs/campaign.md.
///
/// Runs are added inside a transaction: a program that is killed loses those since the last
/// commit() and leaves the file whole.
class CampaignStore {
 public:
  /// Opens a results file to write, or makes it. ":memory:" keeps nothing. Throws UsageError when
  /// the file holds another campaign, JobError when it cannot be written or is in use.
  CampaignStore(const std::string& file, const CampaignPlan& plan);
  /// Opens a results file to read. Throws UsageError when it is none.
  explicit CampaignStore(const std::string& file);
  /// Makes an empty file for the campaign of another one, to merge into.
  CampaignStore(const std::string& file, const CampaignStore& like);

  /// Adds a run; one that is there already must be equal, else JobError.
  void add(const RunResult& result);
  void commit();

  const std::string& file() const { return database_.file(); }
  /// Value of the table meta; "" when there is none.
  std::string meta(const std::string& key);
  const std::vector<StoredPoint>& points() const { return points_; }
  /// (point, run) of every run in the file.
  std::set<std::pair<std::int64_t, std::int64_t>> runs();
  /// Runs of a point within the range, in order.
  std::vector<std::int64_t> runs_of(std::int64_t point, RunRange range);
  RunResult read_run(std::int64_t point, std::int64_t run);

  /// All curves of an estimator, by name; a row for each of the runs. "" for the run's own.
  std::map<std::string, RunMatrix> read_curves(std::int64_t point, const std::string& estimator,
                                               const std::vector<std::int64_t>& runs);
  /// Calls take for each run of the range that scored packets, in order.
  void for_each_packets(std::int64_t point, const std::string& estimator, RunRange range,
                        const std::function<void(std::int64_t, const ScoreHistogram&)>& take);
  TimeHistogram read_step_times(std::int64_t point, const std::string& estimator, RunRange range);
  /// Sums over runs. "" for the run's own.
  std::map<std::string, std::int64_t> read_counters(std::int64_t point,
                                                    const std::string& estimator, RunRange range);

 private:
  void make_tables(const std::vector<StoredPoint>& points,
                   const std::map<std::string, std::string>& meta);
  void read_points();
  std::int64_t series(std::int64_t point, const std::string& estimator, const std::string& name);
  void insert(const RunResult& result);
  void insert_estimator(const RunResult& result, const EstimatorResult& estimator);
  void add_curve(std::int64_t series, std::int64_t run, std::span<const double> values);
  SqliteStatement& insertion(std::string_view sql);
  void begin();
  void for_each_blob(const std::string& table, const std::string& column, std::int64_t point,
                     const std::string& estimator, RunRange range,
                     const std::function<void(std::int64_t, std::span<const std::uint8_t>)>& take);

  SqliteDatabase database_;
  std::map<std::string_view, SqliteStatement> insertions_;  // by their text, each prepared once
  std::vector<StoredPoint> points_;
  std::map<std::pair<std::pair<std::int64_t, std::string>, std::string>, std::int64_t> series_;
  std::set<std::pair<std::int64_t, std::int64_t>> known_runs_;
  bool is_in_transaction_ = false;
};

/// Puts the runs of several results files of one campaign into a new file. Throws UsageError when
/// they are of different campaigns, builds or kernels, JobError when a run stands in two of them
/// with different results.
void merge_campaigns(const std::vector<std::string>& files, const std::string& into);

}  // namespace holdfast
