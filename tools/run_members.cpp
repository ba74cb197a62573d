#include "tools/run_members.h"

#include <algorithm>
#include <holdfast/estimate_t.hpp>
#include <holdfast/status_t.hpp>

#include "common/clock.h"
#include "common/status.h"

namespace holdfast {
namespace {

// An estimate may still be on its way when its sender has already ended.
constexpr std::int64_t kLastEstimateWait_ns = 2'000'000'000;

std::string last_words(const ChildProcess& process) {
  std::string tail = process.output_tail();
  if (tail.empty()) return "; it wrote nothing to " + process.output_file();
  tail.pop_back();
  return "; its last words in " + process.output_file() + ":\n" + tail;
}

}  // namespace

void RunMembers::start(const std::string& name, const std::vector<std::string>& argv, Role role) {
  members_.push_back({ChildProcess(name, argv, folder_ + "/" + name + ".txt"), role});
  const std::size_t index = members_.size() - 1;
  // Anybody can publish anything under these names, so steps are kept within what can be.
  const auto within_run = [this](std::int64_t step) {
    return std::clamp<std::int64_t>(step, 0, num_steps_);
  };
  link_.subscribe<status_t>(channel_name("STATUS_", name),
                            [this, index, within_run](const status_t& status) {
                              members_[index].state = status.state;
                              if (members_[index].role == Role::kOurs)
                                members_[index].step = within_run(status.step);
                            });
  if (role != Role::kOutsideEstimator) return;
  link_.subscribe<estimate_t>(
      channel_name("EST_", name), [this, index, within_run](const estimate_t& estimate) {
        members_[index].step = std::max(members_[index].step, within_run(estimate.step));
      });
}

bool RunMembers::is_ready(const Member& member) const {
  return member.state >= static_cast<std::int32_t>(ProcessState::kReady);
}

bool RunMembers::are_ready() const {
  return std::all_of(members_.begin(), members_.end(),
                     [this](const Member& member) { return is_ready(member); });
}

std::string RunMembers::not_ready() const {
  std::string names;
  for (const Member& member : members_) {
    if (!is_ready(member)) names += (names.empty() ? "" : ", ") + member.process.name();
  }
  return names;
}

std::string RunMembers::find_failure(bool has_plant_started) {
  for (Member& member : members_) {
    ChildProcess& process = member.process;
    if (process.poll() == ChildProcess::State::kRunning) continue;
    const std::string ending = " (" + process.ending() + ")";
    if (!has_plant_started)
      return process.name() + " ended before the run began" + ending + last_words(process);
    if (!process.succeeded())
      return process.name() + " ended before the run was over" + ending + last_words(process);
    if (member.role != Role::kOutsideEstimator || is_done(member)) continue;
    const std::int64_t now_ns = monotonic_time_ns();
    if (member.ended_ns == 0) member.ended_ns = now_ns;
    if (now_ns - member.ended_ns > kLastEstimateWait_ns) {
      return process.name() + " ended before its last step: its newest estimate is of step " +
             std::to_string(member.step) + " of " + std::to_string(num_steps_) + ending +
             last_words(process);
    }
  }
  return "";
}

bool RunMembers::is_done(const Member& member) const {
  switch (member.role) {
    case Role::kOurs:
      return member.process.succeeded();
    case Role::kOutsideEstimator:
      return member.step >= num_steps_;
    case Role::kOutsidePlant:
      return true;
  }
  return false;
}

bool RunMembers::are_done() const {
  return std::all_of(members_.begin(), members_.end(),
                     [this](const Member& member) { return is_done(member); });
}

std::int64_t RunMembers::sum_of_steps() const {
  std::int64_t sum = 0;
  for (const Member& member : members_) sum += member.step;
  return sum;
}

std::int64_t RunMembers::slowest_step() const {
  std::int64_t slowest = num_steps_;
  for (const Member& member : members_) {
    if (member.role != Role::kOutsidePlant) slowest = std::min(slowest, member.step);
  }
  return slowest;
}

std::string RunMembers::steps_text() const {
  std::string text;
  for (const Member& member : members_) {
    if (member.role == Role::kOutsidePlant) continue;
    text += " " + member.process.name() + " at " + std::to_string(member.step) + ";";
  }
  return text;
}

void RunMembers::send(int signal) {
  for (Member& member : members_) member.process.send(signal);
}

bool RunMembers::are_gone() {
  bool are_all_gone = true;
  for (Member& member : members_) are_all_gone = member.process.is_gone() && are_all_gone;
  return are_all_gone;
}

std::string RunMembers::left_over() {
  std::string text;
  for (Member& member : members_) {
    if (member.process.is_gone()) continue;
    text += text.empty() ? "" : ", ";
    text += member.process.is_running() ? member.process.name()
                                        : "what " + member.process.name() + " started";
  }
  return text;
}

}  // namespace holdfast
