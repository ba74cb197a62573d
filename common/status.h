#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "common/lcm_link.h"

namespace holdfast {

enum class ProcessState : std::int32_t {
  kStarting = 0,
  kReady = 1,
  kRunning = 2,
  kFinished = 3,
  kFailed = 4
};

/// Heartbeat of one process on STATUS_<NAME>.
class StatusReporter {
 public:
  StatusReporter(LcmLink& link, const std::string& name) : link_(link), name_(name) {}

  void set_state(ProcessState state) { state_ = state; }
  void set_step(std::int64_t step) { step_ = step; }
  /// Sets what is worth telling now, prints it to stderr, and publishes at once.
  void remark(const std::string& text);
  std::int64_t& counter(const std::string& name) { return counters_[name]; }
  /// Publishes state and counters, those of the link included.
  void publish();

 private:
  LcmLink& link_;
  std::string name_;
  ProcessState state_ = ProcessState::kStarting;
  std::int64_t step_ = 0;
  std::string remark_;
  std::map<std::string, std::int64_t> counters_;
};

/// STATUS_ and the name in upper case; what is no letter, digit or '_' becomes '_'.
std::string channel_name(const std::string& prefix, const std::string& name);

}  // namespace holdfast
