#pragma once

#include <string>

#include "tools/experiment.h"

namespace holdfast {

/// Files of an attack on a recorded bus.
struct OfflineAttack {
  std::string in;        // candump -L log of the sensor-side bus
  std::string out;       // candump -L log: what the monitor-side bus would have seen
  std::string truth;     // JSON lines, one for each touched frame; "" for none
  std::string commands;  // candump -L log of forged commands; "" for none
  bool is_dry = false;   // out is what was read; truth says what would have been done

  bool is_wanted() const {
    return !in.empty() || !out.empty() || !truth.empty() || !commands.empty();
  }
};

/// Runs the scenario's rules over a recording, to the byte as the live proxy decides for the same
/// frames, scenario and seed; a forged frame has the time of the tick that ends its step.
///
/// Every frame of the recording, of whatever interface, is taken as one of the sensor-side bus.
/// Steps begin with that which the recording's first tick ends.
/// Returns what it did, for people. Throws UsageError when in or out is missing, a file cannot be
/// read, holds no frame or exists already, or two outputs are one; JobError when a file cannot be
/// written.
std::string attack_offline(const Experiment& experiment, const OfflineAttack& files);

}  // namespace holdfast
