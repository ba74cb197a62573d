#include "tools/campaign/campaign_store.h"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>

#include "common/run_meta.h"

namespace holdfast {
namespace {

constexpr const char* kSchemaVersion = "1";
constexpr const char* kTables = R"(
CREATE TABLE meta(key TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE points(point INTEGER PRIMARY KEY, settings TEXT NOT NULL, scenario TEXT NOT NULL);
CREATE TABLE estimators(point INTEGER, position INTEGER, name TEXT NOT NULL,
  PRIMARY KEY(point, position));
CREATE TABLE runs(point INTEGER, run INTEGER, PRIMARY KEY(point, run)) WITHOUT ROWID;
CREATE TABLE series(series INTEGER PRIMARY KEY, point INTEGER NOT NULL, estimator TEXT NOT NULL,
  name TEXT NOT NULL, UNIQUE(point, estimator, name));
CREATE TABLE curves(series INTEGER, run INTEGER, steps BLOB NOT NULL,
  PRIMARY KEY(series, run)) WITHOUT ROWID;
CREATE TABLE packets(point INTEGER, estimator TEXT, run INTEGER, bins BLOB NOT NULL,
  PRIMARY KEY(point, estimator, run)) WITHOUT ROWID;
CREATE TABLE detections(point INTEGER, estimator TEXT, run INTEGER, first_step INTEGER,
  last_step INTEGER, detected_step INTEGER,
  PRIMARY KEY(point, estimator, run, first_step)) WITHOUT ROWID;
CREATE TABLE counters(point INTEGER, estimator TEXT, name TEXT, run INTEGER, value INTEGER NOT NULL,
  PRIMARY KEY(point, estimator, name, run)) WITHOUT ROWID;
CREATE TABLE step_times(point INTEGER, estimator TEXT, run INTEGER, counts BLOB NOT NULL,
  PRIMARY KEY(point, estimator, run)) WITHOUT ROWID;
)";

SqliteDatabase open_results(const std::string& file) {
  if (!std::filesystem::exists(file)) throw UsageError(file + ": there is no such file");
  if (!is_sqlite_file(file)) throw UsageError(file + ": no results file of a campaign");
  return {file, SqliteDatabase::Mode::kRead};
}

// How SQLite files say whose they are ("Hold" in letters).
constexpr std::int64_t kApplicationId = 0x486F6C64;

bool has_tables(SqliteDatabase& database) {
  SqliteStatement id = database.prepare("PRAGMA application_id");
  return id.step() && id.integer(0) == kApplicationId;
}

bool is_empty(SqliteDatabase& database) {
  SqliteStatement statement = database.prepare("SELECT count(*) FROM sqlite_master");
  return statement.step() && statement.integer(0) == 0;
}

// What makes two results files parts of one campaign.
constexpr const char* kIdentityKeys[] = {"schema", "scenario", "version",
                                         "commit", "kernel",   "identity"};

}  // namespace

CampaignStore::CampaignStore(const std::string& file, const CampaignPlan& plan)
    : database_(file, SqliteDatabase::Mode::kWrite) {
  const std::map<std::string, std::string> wanted = {
      {"schema", kSchemaVersion}, {"scenario", plan.scenario},    {"version", version_text()},
      {"commit", commit_text()},  {"kernel", plan.kernel_text()}, {"identity", plan.identity()}};
  if (!has_tables(database_)) {
    if (!is_empty(database_))
      throw UsageError(file + " is another program's database; give --out another file");
    std::vector<StoredPoint> points;
    for (const CampaignPoint& point : plan.points) {
      points.push_back(
          {point.settings, point.experiment.resolved, point.experiment.scored_names()});
    }
    make_tables(points, wanted);
  }
  for (const auto& [key, value] : wanted) {
    const std::string there = meta(key);
    if (there == value) continue;
    throw UsageError(file + " holds another campaign: its " +
                     (key == "identity" ? "scenario or sweep differs"
                                        : key + " is '" + there + "', here it is '" + value + "'") +
                     "; give --out another file, or remove this one");
  }
  read_points();
}

CampaignStore::CampaignStore(const std::string& file) : database_(open_results(file)) {
  if (!has_tables(database_) || meta("schema") != kSchemaVersion) {
    throw UsageError(file + ": no results file of a campaign, or one of another version");
  }
  read_points();
}

CampaignStore::CampaignStore(const std::string& file, const CampaignStore& like)
    : database_(file, SqliteDatabase::Mode::kWrite) {
  CampaignStore source(like.file());
  std::map<std::string, std::string> values;
  for (const char* key : kIdentityKeys) values[key] = source.meta(key);
  make_tables(source.points_, values);
  read_points();
}

void CampaignStore::make_tables(const std::vector<StoredPoint>& points,
                                const std::map<std::string, std::string>& meta) {
  begin();
  database_.execute(kTables);
  database_.execute("PRAGMA application_id = " + std::to_string(kApplicationId));
  SqliteStatement add_meta = database_.prepare("INSERT INTO meta VALUES(?, ?)");
  for (const auto& [key, value] : meta) add_meta.bind(key).bind(value).run();
  SqliteStatement add_point = database_.prepare("INSERT INTO points VALUES(?, ?, ?)");
  SqliteStatement add_estimator = database_.prepare("INSERT INTO estimators VALUES(?, ?, ?)");
  for (std::size_t p = 0; p < points.size(); ++p) {
    const auto point = static_cast<std::int64_t>(p);
    add_point.bind(point)
        .bind(nlohmann::json(points[p].settings).dump())
        .bind(points[p].scenario)
        .run();
    for (std::size_t i = 0; i < points[p].estimators.size(); ++i)
      add_estimator.bind(point)
          .bind(static_cast<std::int64_t>(i))
          .bind(points[p].estimators[i])
          .run();
  }
  commit();
}

void CampaignStore::read_points() {
  SqliteStatement points =
      database_.prepare("SELECT settings, scenario FROM points ORDER BY point");
  while (points.step()) {
    const auto settings = nlohmann::json::parse(points.text(0), nullptr, false);
    StoredPoint point;
    if (settings.is_array()) {
      for (const auto& setting : settings)
        if (setting.is_string()) point.settings.push_back(setting);
    }
    point.scenario = points.text(1);
    points_.push_back(std::move(point));
  }
  SqliteStatement names =
      database_.prepare("SELECT point, name FROM estimators ORDER BY point, position");
  while (names.step()) {
    const auto point = static_cast<std::size_t>(names.integer(0));
    if (point < points_.size()) points_[point].estimators.push_back(names.text(1));
  }
  SqliteStatement series = database_.prepare("SELECT series, point, estimator, name FROM series");
  while (series.step())
    series_[{{series.integer(1), series.text(2)}, series.text(3)}] = series.integer(0);
  known_runs_ = runs();
}

void CampaignStore::begin() {
  if (is_in_transaction_) return;
  database_.execute("BEGIN");
  is_in_transaction_ = true;
}

void CampaignStore::commit() {
  if (!is_in_transaction_) return;
  database_.execute("COMMIT");
  is_in_transaction_ = false;
}

std::string CampaignStore::meta(const std::string& key) {
  SqliteStatement statement = database_.prepare("SELECT value FROM meta WHERE key = ?");
  statement.bind(key);
  return statement.step() ? statement.text(0) : "";
}

std::int64_t CampaignStore::series(std::int64_t point, const std::string& estimator,
                                   const std::string& name) {
  const auto [place, is_new] = series_.try_emplace({{point, estimator}, name}, 0);
  if (is_new) {
    place->second = static_cast<std::int64_t>(series_.size());
    database_.prepare("INSERT INTO series VALUES(?, ?, ?, ?)")
        .bind(place->second)
        .bind(point)
        .bind(estimator)
        .bind(name)
        .run();
  }
  return place->second;
}

void CampaignStore::add(const RunResult& result) {
  begin();
  if (!known_runs_.emplace(result.point, result.run).second) {
    RunResult there = read_run(result.point, result.run), given = result;
    for (RunResult* one : {&there, &given})
      for (EstimatorResult& estimator : one->estimators) estimator.step_times = {};
    if (to_bytes(there) != to_bytes(given)) {
      throw JobError("run " + std::to_string(result.run) + " of point " +
                     std::to_string(result.point) + " already stands in " + file() +
                     " with another result: the two were not made by one build on one kernel");
    }
    return;
  }
  insert(result);
}

void CampaignStore::add_curve(std::int64_t series, std::int64_t run,
                              std::span<const double> values) {
  insertion("INSERT INTO curves VALUES(?, ?, ?)")
      .bind(series)
      .bind(run)
      .bind(bytes_of(values))
      .run();
}

SqliteStatement& CampaignStore::insertion(std::string_view sql) {
  const auto found = insertions_.find(sql);
  if (found != insertions_.end()) return found->second;
  return insertions_.emplace(sql, database_.prepare(std::string(sql))).first->second;
}

void CampaignStore::insert(const RunResult& result) {
  insertion("INSERT INTO runs VALUES(?, ?)").bind(result.point).bind(result.run).run();
  add_curve(series(result.point, "", "is_attacked"), result.run, result.is_attacked);
  if (!result.authentic_packets.empty()) {
    add_curve(series(result.point, "", "authentic_packets"), result.run, result.authentic_packets);
  }
  SqliteStatement& counter = insertion("INSERT INTO counters VALUES(?, '', ?, ?, ?)");
  for (const auto& [name, value] : result.counters)
    counter.bind(result.point).bind(name).bind(result.run).bind(value).run();
  for (const EstimatorResult& estimator : result.estimators) insert_estimator(result, estimator);
}

void CampaignStore::insert_estimator(const RunResult& result, const EstimatorResult& estimator) {
  for (const auto& [name, values] : estimator.scores.curves)
    add_curve(series(result.point, estimator.name, name), result.run, values);
  SqliteStatement& counter = insertion("INSERT INTO counters VALUES(?, ?, ?, ?, ?)");
  for (const auto& [name, value] : estimator.scores.outcomes) {
    counter.bind(result.point).bind(estimator.name).bind(name).bind(result.run).bind(value).run();
  }
  if (!estimator.scores.packets.is_empty()) {
    insertion("INSERT INTO packets VALUES(?, ?, ?, ?)")
        .bind(result.point)
        .bind(estimator.name)
        .bind(result.run)
        .bind(bytes_of(estimator.scores.packets))
        .run();
  }
  SqliteStatement& detection = insertion("INSERT INTO detections VALUES(?, ?, ?, ?, ?, ?)");
  for (const DetectionEvent& event : estimator.detections) {
    detection.bind(result.point).bind(estimator.name).bind(result.run);
    detection.bind(event.first_step).bind(event.last_step);
    (event.detected_step < 0 ? detection.bind_null() : detection.bind(event.detected_step)).run();
  }
  insertion("INSERT INTO step_times VALUES(?, ?, ?, ?)")
      .bind(result.point)
      .bind(estimator.name)
      .bind(result.run)
      .bind(bytes_of(estimator.step_times))
      .run();
}

std::set<std::pair<std::int64_t, std::int64_t>> CampaignStore::runs() {
  std::set<std::pair<std::int64_t, std::int64_t>> runs;
  SqliteStatement statement = database_.prepare("SELECT point, run FROM runs");
  while (statement.step()) runs.emplace(statement.integer(0), statement.integer(1));
  return runs;
}

std::vector<std::int64_t> CampaignStore::runs_of(std::int64_t point, RunRange range) {
  std::vector<std::int64_t> runs;
  SqliteStatement statement = database_.prepare(
      "SELECT run FROM runs WHERE point = ? AND run BETWEEN ? AND ? ORDER BY run");
  statement.bind(point).bind(range.first).bind(range.last);
  while (statement.step()) runs.push_back(statement.integer(0));
  return runs;
}

std::map<std::string, RunMatrix> CampaignStore::read_curves(std::int64_t point,
                                                            const std::string& estimator,
                                                            const std::vector<std::int64_t>& runs) {
  std::map<std::string, RunMatrix> curves;
  if (runs.empty()) return curves;
  for (const auto& [key, id] : series_) {
    if (key.first != std::pair(point, estimator)) continue;
    SqliteStatement statement = database_.prepare(
        "SELECT run, steps FROM curves WHERE series = ? AND run BETWEEN ? AND ? ORDER BY run");
    statement.bind(id).bind(runs.front()).bind(runs.back());
    RunMatrix* matrix = nullptr;
    while (statement.step()) {
      const std::vector<double> values = doubles_of(statement.bytes(1));
      if (matrix == nullptr) {
        matrix = &curves
                      .try_emplace(key.second, runs.size(), values.size(),
                                   std::numeric_limits<double>::quiet_NaN())
                      .first->second;
      }
      const auto row = std::lower_bound(runs.begin(), runs.end(), statement.integer(0));
      if (row == runs.end() || *row != statement.integer(0)) continue;
      if (values.size() != matrix->num_steps())
        throw JobError(file() + ": a curve has another length than its neighbours");
      std::copy(values.begin(), values.end(),
                matrix->run(static_cast<std::size_t>(row - runs.begin())).begin());
    }
  }
  return curves;
}

void CampaignStore::for_each_blob(
    const std::string& table, const std::string& column, std::int64_t point,
    const std::string& estimator, RunRange range,
    const std::function<void(std::int64_t, std::span<const std::uint8_t>)>& take) {
  SqliteStatement statement =
      database_.prepare("SELECT run, " + column + " FROM " + table +
                        " WHERE point = ? AND estimator = ? AND run BETWEEN ? AND ? ORDER BY run");
  statement.bind(point).bind(estimator).bind(range.first).bind(range.last);
  while (statement.step()) take(statement.integer(0), statement.bytes(1));
}

void CampaignStore::for_each_packets(
    std::int64_t point, const std::string& estimator, RunRange range,
    const std::function<void(std::int64_t, const ScoreHistogram&)>& take) {
  for_each_blob("packets", "bins", point, estimator, range,
                [&take](std::int64_t run, auto bytes) { take(run, score_histogram_of(bytes)); });
}

TimeHistogram CampaignStore::read_step_times(std::int64_t point, const std::string& estimator,
                                             RunRange range) {
  TimeHistogram sum;
  for_each_blob("step_times", "counts", point, estimator, range,
                [&sum](std::int64_t, auto bytes) { sum.add(time_histogram_of(bytes)); });
  return sum;
}

std::map<std::string, std::int64_t> CampaignStore::read_counters(std::int64_t point,
                                                                 const std::string& estimator,
                                                                 RunRange range) {
  std::map<std::string, std::int64_t> sums;
  SqliteStatement statement = database_.prepare(
      "SELECT name, sum(value) FROM counters WHERE point = ? AND estimator = ? AND run BETWEEN ? "
      "AND ? GROUP BY name");
  statement.bind(point).bind(estimator).bind(range.first).bind(range.last);
  while (statement.step()) sums[statement.text(0)] = statement.integer(1);
  return sums;
}

RunResult CampaignStore::read_run(std::int64_t point, std::int64_t run) {
  RunResult result;
  result.point = point;
  result.run = run;
  const RunRange only{run, run};
  const auto curve = [&](const std::string& estimator) {
    std::map<std::string, std::vector<double>> curves;
    for (const auto& [name, matrix] : read_curves(point, estimator, {run})) {
      const auto values = matrix.run(0);
      curves[name].assign(values.begin(), values.end());
    }
    return curves;
  };
  auto whole = curve("");
  result.is_attacked = std::move(whole["is_attacked"]);
  result.authentic_packets = std::move(whole["authentic_packets"]);
  result.counters = read_counters(point, "", only);
  if (point < 0 || point >= static_cast<std::int64_t>(points_.size())) return result;
  for (const std::string& name : points_[static_cast<std::size_t>(point)].estimators) {
    EstimatorResult estimator;
    estimator.name = name;
    estimator.scores.curves = curve(name);
    estimator.scores.outcomes = read_counters(point, name, only);
    for_each_packets(point, name, only, [&estimator](std::int64_t, const ScoreHistogram& packets) {
      estimator.scores.packets = packets;
    });
    estimator.step_times = read_step_times(point, name, only);
    SqliteStatement events = database_.prepare(
        "SELECT first_step, last_step, detected_step FROM detections WHERE point = ? AND estimator "
        "= ? AND run = ? ORDER BY first_step");
    events.bind(point).bind(name).bind(run);
    while (events.step()) {
      estimator.detections.push_back(
          {events.integer(0), events.integer(1), events.is_null(2) ? -1 : events.integer(2)});
    }
    result.estimators.push_back(std::move(estimator));
  }
  return result;
}

namespace {

void add_all(const std::string& file, CampaignStore& merged) {
  CampaignStore source(file);
  for (const auto& [point, run] : source.runs()) {
    try {
      merged.add(source.read_run(point, run));
    } catch (const JobError& error) {
      throw JobError(file + ", run " + std::to_string(run) + ": " + error.what());
    }
  }
  merged.commit();
}

}  // namespace

void merge_campaigns(const std::vector<std::string>& files, const std::string& into) {
  if (files.empty()) throw UsageError("there is nothing to merge");
  if (std::filesystem::exists(into))
    throw UsageError(into + " exists; give --out a new file to merge into");
  CampaignStore first(files.front());
  for (const std::string& file : files) {
    CampaignStore other(file);
    for (const char* key : kIdentityKeys) {
      if (other.meta(key) == first.meta(key)) continue;
      throw UsageError(file + " and " + files.front() + " are no parts of one campaign: their " +
                       key + " differs ('" + other.meta(key) + "' and '" + first.meta(key) + "')");
    }
  }
  const std::string unfinished = into + ".part";
  std::filesystem::remove(unfinished);
  try {
    CampaignStore merged(unfinished, first);
    for (const std::string& file : files) add_all(file, merged);
  } catch (...) {
    std::filesystem::remove(unfinished);
    std::filesystem::remove(unfinished + "-journal");
    throw;
  }
  std::filesystem::rename(unfinished, into);
}

}  // namespace holdfast
