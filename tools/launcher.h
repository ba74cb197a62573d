#pragma once

#include <string>
#include <vector>

namespace holdfast {

struct LaunchOptions {
  std::string scenario;
  std::vector<std::string> overrides;
  std::string lcm_url;  // "": a free port of its own
  std::string runs_folder = "runs";
  std::string program_folder;  // where the other holdfast programs stand
  std::vector<std::string> owned_buses;
  std::string control;            // path of the attacker's control socket; "" for none
  bool is_dry = false;            // the attacker only says what it would do
  double ready_timeout_s = 30.0;  // until every process says that it is ready
  double stall_timeout_s = 20.0;  // without a new step; at least five periods
  bool shows_progress = false;    // a line that is written over; for terminals
};

/// Starts the processes of a scenario, records them, stops them, and prints the results table.
///
/// Returns 0 when every process finished, 1 when one failed or the run stalled, 130 after Ctrl-C.
/// Throws UsageError for a wrong scenario and JobError when the run cannot start.
int launch(const LaunchOptions& options);

}  // namespace holdfast
