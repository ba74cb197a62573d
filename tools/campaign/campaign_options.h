#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tools/campaign/campaign.h"
#include "tools/program_options.h"

namespace holdfast {

/// Command line of holdfast-campaign.
struct CampaignProgramOptions : ProgramOptions {
  std::int64_t runs = 0, first_run = 0;  // runs 0: the scenario's
  int threads = 0;
  std::vector<std::string> sweeps, points, merged;
  std::string shard, out, json, csv, log;
  std::uint32_t run = 0;

  void add_to(CLI::App& app);
  /// Throws UsageError for a file that could not be written after hours of work.
  void check_outputs() const;
  /// What to run. Throws UsageError.
  CampaignPlan plan() const;
  /// The file for results, its folder made: --out, or one that this plan and build always get.
  std::string results_file(const CampaignPlan& plan) const;
};

/// Says on standard error how far a campaign is, with rate and time left, four times a second.
class CampaignProgressLine {
 public:
  CampaignProgressLine();
  void operator()(std::int64_t done, std::int64_t earlier, std::int64_t total);

 private:
  std::int64_t started_ns_, shown_ns_ = 0;
};

}  // namespace holdfast
