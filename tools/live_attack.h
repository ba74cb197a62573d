#pragma once

#include <string>
#include <vector>

#include "tools/experiment.h"

namespace holdfast {

/// What a live attacker stands between, and how.
struct LiveAttack {
  std::string from, to;  // URLs of the sensor-side and the monitor-side bus
  std::string lcm_url;
  std::vector<std::string> owned_buses;
  std::string control;         // path of a local socket on which rules can be changed; "" for none
  bool is_dry = false;         // forwards all as it is, and only says what it would do
  bool no_record = false;      // neither truth nor status on LCM
  bool ignore_losses = false;  // status 0 even when frames were lost
};

/// Runs the attacker until the scenario's last step or a signal. Returns the exit status: 1 after a
/// signal, when frames were lost, or when the counters do not balance. Throws UsageError for buses
/// that are missing or the same, JobError when another attacker stands there.
int attack_live(const Experiment& experiment, const LiveAttack& options);

}  // namespace holdfast
