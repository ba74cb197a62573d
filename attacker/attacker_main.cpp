#include <array>
#include <holdfast/attack_frame_t.hpp>
#include <holdfast/can_frames_t.hpp>
#include <iostream>

#include "attacker/attack_messages.h"
#include "common/status.h"
#include "drivers/can/can_bus.h"
#include "drivers/can/can_messages.h"
#include "drivers/event_loop.h"
#include "drivers/socket_lock.h"
#include "tools/program_options.h"

namespace holdfast {
namespace {

constexpr std::size_t kRecordBatchMax = 256;

struct AttackerOptions : ProgramOptions {
  std::string from, to;
  bool no_record = false;
};

// Moves frames from the sensor-side to the monitor-side bus; truth goes to LCM unless not wanted.
class AttackerProcess {
 public:
  AttackerProcess(const Experiment& experiment, const AttackerOptions& options, LcmLink* link)
      : experiment_(experiment), link_(link), core_(experiment.make_proxy(0)) {
    if (link_ != nullptr) status_.emplace(*link_, "attacker");
    sent_record_.bus = options.to;
  }

  void remark(const std::string& text) {
    if (status_) {
      status_->remark(text);
    } else {
      std::cerr << "holdfast attacker: " << text << std::endl;
    }
  }
  void set_state(ProcessState state) {
    if (status_) status_->set_state(state);
  }
  bool is_finished() const { return core_.current_step() > experiment_.num_steps; }

  void on_readable(CanBus& from, CanBus& to) {
    for (;;) {
      const std::size_t count = from.read(batch_);
      out_.clear();
      records_.clear();
      for (std::size_t i = 0; i < count && !is_finished(); ++i) core_.on_frame(batch_[i], out_, records_);
      if (!out_.empty()) to.write(out_);
      if (link_ != nullptr) record();
      if (count < batch_.size() || is_finished()) return;
    }
  }

  void publish_status(CanBus& from, CanBus& to) {
    if (!status_) return;
    const ProxyCounters& frames = core_.counters();
    const BusCounters rx = from.counters(), tx = to.counters();
    const std::pair<const char*, std::int64_t> values[] = {
        {"received", frames.received}, {"sent", frames.sent}, {"passed", frames.passed},
        {"altered", frames.altered}, {"dropped", frames.dropped}, {"injected", frames.injected},
        {"odd_ticks", frames.odd_ticks}, {"bus_kernel_dropped", rx.kernel_dropped},
        {"bus_refused", rx.refused}, {"bus_write_dropped", tx.write_dropped},
        {"bus_error_frames", rx.error_frames + tx.error_frames},
        {"bus_times_down", rx.times_down + tx.times_down}};
    for (const auto& [name, value] : values) status_->counter(name) = value;
    status_->set_step(core_.current_step() - 1);
    status_->publish();
  }

  void flush_record() {
    if (link_ == nullptr || sent_record_.frames.empty()) return;
    sent_record_.step = core_.current_step();
    sent_record_.num_frames = static_cast<std::int32_t>(sent_record_.frames.size());
    link_->publish("CAN_TX", sent_record_);
    sent_record_.frames.clear();
    recorded_step_ = core_.current_step();
  }

 private:
  void record() {
    for (const AttackRecord& touched : records_) {
      to_message(touched, core_.rules(), experiment_.model.step_s, attack_frame_);
      link_->publish("ATTACK_FRAME", attack_frame_);
    }
    if (!experiment_.record_frames) return;
    for (const CanFrame& frame : out_) {
      to_message(frame, tx_index_++, sent_record_.frames.emplace_back());
      if (sent_record_.frames.size() >= kRecordBatchMax) flush_record();
    }
    if (core_.current_step() != recorded_step_) flush_record();
  }

  const Experiment& experiment_;
  LcmLink* link_;
  std::optional<StatusReporter> status_;
  ProxyCore core_;
  std::array<CanFrame, 64> batch_;
  std::vector<CanFrame> out_;
  std::vector<AttackRecord> records_;
  std::int64_t tx_index_ = 0, recorded_step_ = 1;
  attack_frame_t attack_frame_;
  can_frames_t sent_record_;
};

int run(const AttackerOptions& options) {
  if (options.from == options.to) throw UsageError("--from and --to are the same bus: frames would run in circles");
  const Experiment experiment = options.load();
  const SocketLock lock("holdfast-proxy " + options.from + " " + options.to,
                        "another holdfast-attacker already runs between " + options.from + " and " + options.to);
  std::optional<LcmLink> link;
  if (!options.no_record) link.emplace(options.lcm_url);
  AttackerProcess attacker(experiment, options, link ? &*link : nullptr);
  BusOptions bus_options;
  bus_options.owned_url = options.owned_bus;
  bus_options.on_event = [&attacker](const std::string& event) { attacker.remark(event); };
  const std::unique_ptr<CanBus> from = open_can_bus(options.from, bus_options);
  bus_options.may_write = true;
  const std::unique_ptr<CanBus> to = open_can_bus(options.to, bus_options);

  EventLoop loop;
  bool is_stopped = false;
  loop.watch_bus(*from, [&] {
    attacker.on_readable(*from, *to);
    if (attacker.is_finished()) loop.stop();
  });
  // Frames on the monitor side are not ours to forward; reading keeps its queue short and tells its state.
  std::array<CanFrame, 64> ignored;
  loop.watch_bus(*to, [&] { while (to->read(ignored) == ignored.size()) continue; });
  loop.every(0.25, [&] { attacker.publish_status(*from, *to); });
  loop.on_stop_signal([&] {
    is_stopped = true;
    loop.stop();
  });
  attacker.set_state(ProcessState::kReady);
  attacker.publish_status(*from, *to);
  std::cout << "ready" << std::endl;
  loop.run();
  attacker.flush_record();
  attacker.set_state(is_stopped ? ProcessState::kFailed : ProcessState::kFinished);
  attacker.publish_status(*from, *to);
  return is_stopped ? 1 : 0;
}

}  // namespace
}  // namespace holdfast

int main(int argc, char** argv) {
  CLI::App app{"The man in the middle: forwards frames from the sensor-side to the monitor-side bus and applies the scenario's attacks."};
  app.footer("Example:\n  holdfast-attacker scenarios/binary_tracking.yaml --from socketcan:vcan0 --to socketcan:vcan1");
  holdfast::AttackerOptions options;
  options.add_scenario(app);
  options.add_lcm(app);
  options.add_owned_bus(app);
  app.add_option("--from", options.from, "Sensor-side bus URL (opened read-only)")->required();
  app.add_option("--to", options.to, "Monitor-side bus URL")->required();
  app.add_flag("--no-record", options.no_record, "Neither truth nor status on LCM: forward only");
  const int status = holdfast::parse_command_line(app, "holdfast-attacker", argc, argv);
  if (status >= 0) return status;
  return holdfast::run_program("holdfast-attacker", [&] { return holdfast::run(options); });
}
