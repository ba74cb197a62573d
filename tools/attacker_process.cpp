#include "tools/attacker_process.h"

#include <algorithm>
#include <iostream>

#include "attacker/attack_messages.h"
#include "common/clock.h"

namespace holdfast {
namespace {

constexpr int kReadsPerLook = 16;
constexpr std::int64_t kTurnMax_ns = 200'000'000;

}  // namespace

AttackerProcess::AttackerProcess(const Experiment& experiment, const std::string& to_url,
                                 LcmLink* link, AttackerMode mode)
    : experiment_(experiment),
      link_(link),
      core_(experiment.make_proxy(0, mode.is_controlled)),
      is_dry_(mode.is_dry) {
  if (link_ == nullptr) return;
  status_.emplace(*link_, "attacker");
  if (experiment.record_frames) sent_record_.emplace(*link_, "CAN_TX", to_url, experiment.step_s());
}

void AttackerProcess::remark(const std::string& text) {
  if (status_) {
    status_->remark(text);
  } else {
    std::cerr << "holdfast attacker: " << text << std::endl;
  }
}

void AttackerProcess::set_state(ProcessState state) {
  if (status_) status_->set_state(state);
}

int AttackerProcess::end_status(CanBus& from, CanBus& to) const {
  const BusCounters &at_sensors = from.counters(), &at_monitor = to.counters();
  const std::int64_t lost = at_sensors.kernel_dropped + at_sensors.write_dropped +
                            at_monitor.write_dropped +
                            (has_way_back() ? at_monitor.kernel_dropped : 0);
  const bool balances = core_.counters().balance() && core_.command_counters().balance();
  if (lost > 0) std::cerr << "holdfast-attacker: " << lost << " frames were lost" << std::endl;
  if (!balances) std::cerr << "holdfast-attacker: frames are not accounted for" << std::endl;
  return lost > 0 || !balances ? 1 : 0;
}

void AttackerProcess::on_readable(CanBus& from, CanBus& to) {
  // What goes back is due in a certain step: no read may wait, and the other bus has the next turn.
  if (has_way_back()) {
    forward_batch(from.read(batch_));
    send(from, to);
    return;
  }
  // Bounded in time, so that timers, signals and control get their turn. The clock is asked rarely:
  // in a guest kernel it costs as much as a read.
  const std::int64_t started_ns = monotonic_time_ns();
  out_.clear();
  bool is_last = false;
  for (int reads = 1;; ++reads) {
    if (reads % kReadsPerLook == 0) is_last = monotonic_time_ns() - started_ns > kTurnMax_ns;
    // Frames whose record nobody waits for go with the next read: in one system call where it can
    // be.
    if (is_last) send(from, to);
    const std::size_t count = is_last ? from.read(batch_) : from.hand_over(to, out_.frames, batch_);
    forward_batch(count);
    const bool is_over = count == 0 || is_last || is_finished();
    if (link_ == nullptr && !is_over) continue;
    send(from, to);
    out_.clear();
    if (is_over) return;
  }
}

void AttackerProcess::forward_batch(std::size_t count) {
  out_.clear();
  for (std::size_t i = 0; i < count && !is_finished(); ++i) forward(batch_[i]);
  leave_unchanged();
}

void AttackerProcess::leave_unchanged() {
  if (!is_dry_) return;
  out_.frames.swap(read_);
  out_.commands.swap(read_commands_);
  read_.clear();
  read_commands_.clear();
}

void AttackerProcess::forward(const CanFrame& frame) {
  const std::size_t num_commands = out_.commands.size();
  if (is_dry_) read_.push_back(frame);
  core_.on_frame(frame, out_);
  if (!is_finished()) return;
  // The plant ends with its last step: nobody is there to obey what is forged when that ends.
  commands_after_end_ += static_cast<std::int64_t>(out_.commands.size() - num_commands);
  out_.commands.resize(num_commands);
}

void AttackerProcess::on_monitor_readable(CanBus& from, CanBus& to) {
  for (std::size_t count = batch_.size(); count == batch_.size();) {
    count = to.read(batch_);
    out_.clear();
    if (!has_way_back()) continue;
    for (std::size_t i = 0; i < count; ++i) {
      if (is_dry_ && core_.goes_back(batch_[i])) read_commands_.push_back(batch_[i]);
      core_.on_monitor_frame(batch_[i], out_);
    }
    leave_unchanged();
    send(from, to);
  }
}

void AttackerProcess::send(CanBus& from, CanBus& to) {
  // Commands first: they are awaited for their steps.
  if (!out_.commands.empty()) from.write(out_.commands);
  if (!out_.frames.empty()) to.write(out_.frames);
  if (link_ == nullptr) return;
  record(out_.records);
  record(out_.command_records);
  for (const RuleSignal& signal : out_.signals) {
    if (is_dry_) break;
    to_message(signal, core_.rules(), experiment_.step_s(), attack_signal_);
    link_->publish("ATTACK_SIGNAL", attack_signal_);
  }
  if (sent_record_) {
    for (const CanFrame& frame : out_.frames) sent_record_->add(frame, core_.current_step());
  }
  if (core_.current_step() == recorded_step_) return;
  status_->set_state(ProcessState::kRunning);
  flush_record();
}

void AttackerProcess::record(const std::vector<AttackRecord>& records) {
  for (const AttackRecord& touched : records) {
    to_message(touched, core_.rules(), experiment_.step_s(), attack_frame_);
    link_->publish(is_dry_ ? "ATTACK_LABEL" : "ATTACK_FRAME", attack_frame_);
  }
}

void AttackerProcess::flush_record() {
  if (sent_record_) sent_record_->flush(core_.current_step());
  recorded_step_ = core_.current_step();
}

void AttackerProcess::publish_status(CanBus& from, CanBus& to) {
  if (!status_) return;
  const ProxyCounters &frames = core_.counters(), &commands = core_.command_counters();
  const BusCounters rx = from.counters(), tx = to.counters();
  const std::pair<const char*, std::int64_t> values[] = {
      {"received", frames.received},
      {"sent", frames.sent},
      {"passed", frames.passed},
      {"altered", frames.altered},
      {"dropped", frames.dropped},
      {"injected", frames.injected},
      {"duplicated", frames.duplicated},
      {"held", frames.held},
      {"released", frames.released},
      {"odd_ticks", frames.odd_ticks},
      {"generation", core_.generation()},
      {"commands_received", commands.received},
      {"commands_sent", commands.sent - commands_after_end_},
      {"commands_altered", commands.altered},
      {"commands_dropped", commands.dropped},
      {"commands_injected", commands.injected},
      {"commands_duplicated", commands.duplicated},
      {"commands_held", commands.held},
      {"commands_released", commands.released},
      {"commands_after_end", commands_after_end_},
      {"bus_kernel_dropped", rx.kernel_dropped + (has_way_back() ? tx.kernel_dropped : 0)},
      {"bus_refused", rx.refused + (has_way_back() ? tx.refused : 0)},
      {"bus_write_dropped", rx.write_dropped + tx.write_dropped},
      {"bus_error_frames", rx.error_frames + tx.error_frames},
      {"bus_times_down", rx.times_down + tx.times_down}};
  for (const auto& [name, value] : values) status_->counter(name) = value;
  status_->set_step(core_.current_step() - 1);
  status_->publish();
}

}  // namespace holdfast
