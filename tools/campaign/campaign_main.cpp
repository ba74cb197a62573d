#include <unistd.h>

#include <iostream>

#include "tools/campaign/campaign_options.h"
#include "tools/campaign/campaign_summary.h"
#include "tools/campaign/campaign_table.h"
#include "tools/campaign/stop_signals.h"
#include "tools/review_report.h"
#include "tools/run_log.h"

namespace holdfast {
namespace {

constexpr const char* kExamples =
    "Examples:\n"
    "  holdfast-campaign scenarios/binary_tracking.yaml --runs 400\n"
    "  holdfast-campaign scenarios/binary_tracking.yaml --sweep "
    "attacks.flip.probability=0,0.1,0.2\n"
    "  mpirun holdfast-campaign scenarios/binary_tracking.yaml --runs 100000 --out big.sqlite\n"
    "  holdfast-campaign scenarios/binary_tracking.yaml --shard 2/8 --out part2.sqlite\n"
    "  holdfast-campaign --merge part1.sqlite part2.sqlite --out all.sqlite\n"
    "  holdfast-campaign scenarios/binary_tracking.yaml --log run3.lcm --run 3    (one run's log)\n"
    "Started again after whatever ended it, the same command goes on where it was.";

void write(const std::string& file, const std::string& text) {
  if (file == "-") {
    std::cout << text;
  } else if (!file.empty()) {
    write_text_file(file, text);
  }
}

void show(CampaignStore& store, RunRange range, const CampaignProgramOptions& options) {
  if (store.runs().empty()) {
    std::cout << store.file() << ": there is no run for this shard\n";
    return;
  }
  const CampaignSummary summary = summarise(store, range, options.threads);
  if (options.json != "-" && options.csv != "-") {
    std::cout << to_text(summary);
    if (store.file() != ":memory:")
      std::cout << "results: " << store.file() << "   (holdfast-review " << store.file() << ")\n";
  }
  write(options.json, to_json(summary));
  write(options.csv, to_csv(summary));
}

int merge(const CampaignProgramOptions& options) {
  if (options.out.empty() || options.out == ":memory:")
    throw UsageError("--merge needs --out, the file to merge into");
  merge_campaigns(options.merged, options.out);
  CampaignStore store(options.out);
  show(store, {}, options);
  return 0;
}

int run(const CampaignProgramOptions& options, ProcessGroup& group) {
  CampaignOptions campaign;
  campaign.num_threads = options.threads;
  if (group.rank() > 0) {
    serve_campaign(group, campaign);
    return 0;
  }
  if (group.size() > 1 && (!options.merged.empty() || !options.log.empty()))
    throw UsageError("--merge and --log are work for one process: start them without mpirun");
  options.check_outputs();
  if (!options.merged.empty()) return merge(options);
  if (options.scenario.empty()) throw UsageError("no scenario given; see --help");
  if (!options.log.empty()) {
    write_run_log(options.load(), options.run, options.log);
    std::cout << "run " << options.run << ": " << options.log << "   (holdfast-review "
              << options.log << ")\n";
    return 0;
  }
  const CampaignPlan plan = options.plan();
  for (const EstimatorEntry& entry : plan.points.front().experiment.estimators) {
    if (entry.is_outside())
      std::cerr << "holdfast-campaign: " << entry.name << " is an outside command: left out\n";
  }
  StopSignals signals;  // first: who sees the file may stop the campaign as it wants to be stopped
  CampaignStore store(options.results_file(plan), plan);
  campaign.should_stop = [&signals] { return signals.has_come(); };
  if (isatty(STDERR_FILENO) != 0) campaign.on_progress = CampaignProgressLine();
  run_campaign(plan, store, group, campaign);
  show(store, {plan.first_run, plan.first_run + plan.num_runs - 1}, options);
  return 0;
}

}  // namespace
}  // namespace holdfast

int main(int argc, char** argv) {
  CLI::App app{
      "Runs a scenario many times in process, with the plant, codec, attacker and estimators of a "
      "live run, on all processors of one machine or (by mpirun) of many."};
  app.footer(holdfast::kExamples);
  holdfast::CampaignProgramOptions options;
  options.add_to(app);
  return holdfast::run_command_line(app, "holdfast-campaign", argc, argv, [&] {
    holdfast::ProcessGroup group;
    const int result =
        holdfast::run_program("holdfast-campaign", [&] { return holdfast::run(options, group); });
    if (result != 0) group.abort(result);
    return result;
  });
}
