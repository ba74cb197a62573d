#pragma once

#include <array>
#include <holdfast/attack_frame_t.hpp>
#include <holdfast/attack_signal_t.hpp>
#include <optional>
#include <string>
#include <vector>

#include "common/status.h"
#include "drivers/can/can_bus.h"
#include "tools/experiment.h"
#include "tools/frame_record.h"

namespace holdfast {

struct AttackerMode {
  bool is_dry = false;         // forwards all frames as they are, and only says what it would do
  bool is_controlled = false;  // rules may change while it runs
};

/// What holdfast-attacker does: frames from the sensor-side to the monitor-side bus, truth to LCM.
class AttackerProcess {
 public:
  /// link: null forwards without any record or status.
  AttackerProcess(const Experiment& experiment, const std::string& to_url, LcmLink* link,
                  AttackerMode mode = {});

  void remark(const std::string& text);
  void set_state(ProcessState state);
  /// 0, or 1 when frames were lost or the counters do not balance; then it says so.
  int end_status(CanBus& from, CanBus& to) const;
  bool is_finished() const { return core_.current_step() > experiment_.num_steps; }

  /// True when frames go back from the monitor-side bus, commands or what sensors are told: both
  /// buses are read and written.
  bool has_way_back() const { return experiment_.layout.has_way_back(); }

  /// Forwards what arrives from the sensor-side bus: all, waiting for more meanwhile, and where
  /// frames go back one batch without waiting.
  void on_readable(CanBus& from, CanBus& to);
  /// Forwards the commands among what has arrived from the monitor-side bus. Reading the rest tells
  /// the bus's state, and keeps the queue short where the bus delivers frames all the same.
  void on_monitor_readable(CanBus& from, CanBus& to);
  void publish_status(CanBus& from, CanBus& to);
  void flush_record();
  /// Of a controlled one, for who changes its rules between two calls.
  ProxyCore& core() { return core_; }

 private:
  void forward_batch(std::size_t count);
  void leave_unchanged();
  void forward(const CanFrame& frame);
  void send(CanBus& from, CanBus& to);
  void record(const std::vector<AttackRecord>& records);

  const Experiment& experiment_;
  LcmLink* link_;
  std::optional<StatusReporter> status_;
  std::optional<FrameRecord> sent_record_;
  ProxyCore core_;
  std::array<CanFrame, 64> batch_;
  ProxyOutput out_;
  bool is_dry_;
  std::vector<CanFrame> read_, read_commands_;  // as they came, to be forwarded when it is dry
  std::int64_t commands_after_end_ = 0;         // forged, but not sent any more
  std::int64_t recorded_step_ = 1;
  attack_frame_t attack_frame_;
  attack_signal_t attack_signal_;
};

}  // namespace holdfast
