#include "tools/campaign/campaign_options.h"

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <sstream>

#include "common/clock.h"

namespace holdfast {
namespace {

constexpr std::int64_t kShown_ns = 250'000'000;

// CLI11's own checks print a range that ends in 300 digits.
CLI::Validator whole_number(long least) {
  const std::string what =
      "a whole number of at least " + std::to_string(least) + " (and below 2^31)";
  return {[least, what](std::string& text) {
            char* end = nullptr;
            const long value = std::strtol(text.c_str(), &end, 10);
            const bool fits = !text.empty() && *end == '\0' && value >= least && value < (1L << 31);
            return fits ? std::string() : "'" + text + "' is not " + what;
          },
          "INT"};
}

void read_shard(const std::string& text, CampaignPlan& plan) {
  char slash = 0;
  std::istringstream stream(text);
  if (!(stream >> plan.shard >> slash >> plan.num_shards) || slash != '/' || !stream.eof() ||
      plan.shard < 1 || plan.shard > plan.num_shards) {
    throw UsageError("--shard " + text + ": write it as i/n with i from 1 to n");
  }
}

}  // namespace

void CampaignProgramOptions::add_to(CLI::App& app) {
  auto* file = app.add_option("--scenario,scenario", scenario, "Scenario file (YAML)");
  app.add_option("--set", overrides, "Override a key: path.to.key=value (repeatable)")
      ->allow_extra_args(false);
  auto* num =
      app.add_option("--runs", runs, "Runs of each point [campaign.runs]")->check(whole_number(1));
  auto* first = app.add_option("--first-run", first_run, "Index of the first run [0]")
                    ->check(whole_number(0));
  auto* sweep = app.add_option("--sweep", sweeps,
                               "Sweep a key: path.to.key=v1,v2,... (several: every combination)")
                    ->allow_extra_args(false);
  auto* point =
      app.add_option("--point", points, "Add a point: 'path=value; path=value' (repeatable)")
          ->allow_extra_args(false);
  auto* part = app.add_option("--shard", shard, "Only the i-th of n parts of the runs: i/n");
  auto* num_threads =
      app.add_option("--threads", threads, "Threads of each process [its processors]")
          ->check(whole_number(1));
  app.add_option("--out", out,
                 "Results file (SQLite), continued when it is there; ':memory:' keeps nothing "
                 "[runs/campaign-NAME-HASH.sqlite]");
  auto* to_json = app.add_option(
      "--json", json,
      "Write the aggregate, curves included; '-': to standard output instead of the table");
  auto* to_csv = app.add_option("--csv", csv, "Write the metrics as CSV to this file");
  auto* to_log = app.add_option("--log", log, "Write one run as an LCM log instead");
  for (auto* other : {num, first, sweep, point, part, num_threads, to_json, to_csv})
    to_log->excludes(other);
  app.add_option("--run", run, "Which run to write [0]")->needs(to_log);
  auto* to_merge =
      app.add_option("--merge", merged, "Merge results files of shards into --out instead")
          ->excludes(file);
  for (auto* other : {num, first, sweep, point, part, num_threads, to_log})
    to_merge->excludes(other);
}

void CampaignProgramOptions::check_outputs() const {
  for (const std::string& file : {json, csv, log, out}) {
    if (file.empty() || file == "-" || file == ":memory:") continue;
    const std::filesystem::path path(file);
    const std::string folder = path.has_parent_path() ? path.parent_path().string() : ".";
    if (!std::filesystem::is_directory(folder))
      throw UsageError(file + ": there is no folder " + folder);
    if (std::filesystem::is_directory(path)) throw UsageError(file + ": is a folder");
    if (access(folder.c_str(), W_OK) != 0)
      throw UsageError(file + ": the folder " + folder + " may not be written to");
  }
}

CampaignPlan CampaignProgramOptions::plan() const {
  Sweep sweep;
  for (const std::string& text : sweeps) sweep.grid.push_back(parse_sweep_axis(text));
  for (const std::string& text : points) sweep.list.push_back(parse_sweep_point(text));
  CampaignPlan plan = load_campaign_plan(scenario, overrides, sweep);
  if (runs > 0) plan.num_runs = runs;
  plan.first_run = first_run;
  if (!shard.empty()) read_shard(shard, plan);
  plan.check_size();
  return plan;
}

std::string CampaignProgramOptions::results_file(const CampaignPlan& plan) const {
  if (!out.empty()) return out;
  std::filesystem::create_directories("runs");
  const std::string part = plan.num_shards == 1 ? ""
                                                : "-shard" + std::to_string(plan.shard) + "of" +
                                                      std::to_string(plan.num_shards);
  return "runs/campaign-" + plan.scenario + "-" + plan.identity().substr(0, 8) + part + ".sqlite";
}

CampaignProgressLine::CampaignProgressLine() : started_ns_(monotonic_time_ns()) {}

void CampaignProgressLine::operator()(std::int64_t done, std::int64_t earlier, std::int64_t total) {
  const std::int64_t now_ns = monotonic_time_ns();
  if (now_ns - shown_ns_ < kShown_ns && done < total) return;
  shown_ns_ = now_ns;
  const double rate =
      static_cast<double>(done - earlier) / (static_cast<double>(now_ns - started_ns_) * 1e-9);
  std::cerr << "\rrun " << done << " of " << total << ", " << static_cast<std::int64_t>(rate)
            << "/s";
  if (done > earlier) {
    std::cerr << ", " << static_cast<std::int64_t>(static_cast<double>(total - done) / rate)
              << " s left   ";
  }
  std::cerr << (done == total ? "\n" : "") << std::flush;
}

}  // namespace holdfast
