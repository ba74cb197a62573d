#include "tools/live_modbus.h"

#include <algorithm>
#include <functional>
#include <utility>

#include "common/errors.h"
#include "common/pacer.h"
#include "drivers/event_loop.h"
#include "tools/modbus_process.h"

namespace holdfast {
namespace {

// A step at each deadline, a request at each turn of the loop, so that signals need not wait for
// units that are silent.
int ask_units(const Experiment& experiment, const LiveModbus& options, CanBus& bus, LcmLink& link) {
  ModbusGateway gateway(experiment, options.line, bus, link);
  EventLoop loop;
  Pacer pacer(std::max(experiment.period_s, 1e-3));
  bool is_asking = false, is_due = false;
  std::int64_t num_late = 0;
  std::function<void()> ask = [&] {
    is_asking = !gateway.ask_next() || std::exchange(is_due, false);
    if (gateway.is_finished()) {
      loop.stop();
    } else if (is_asking) {
      loop.after(gateway.gap_s(), ask);
    }
  };
  loop.watch(pacer.file_descriptor(), [&] {
    if (pacer.acknowledge() == 0) return;
    if (is_asking) {
      is_due = true;
      ++num_late;
    } else {
      ask();
    }
    gateway.status().counter("missed_deadlines") = pacer.missed() + num_late;
  });
  loop.every(0.25, [&] { gateway.status().publish(); });
  loop.on_stop_signal([&] { loop.stop(); });
  gateway.status().set_state(ProcessState::kReady);
  gateway.status().remark("asks the units on " + options.line + ", " +
                          std::to_string(experiment.num_steps) + " steps");
  loop.run();
  const std::string fault =
      gateway.is_finished() ? gateway.fault() : "stopped before the last step";
  gateway.status().set_state(fault.empty() ? ProcessState::kFinished : ProcessState::kFailed);
  if (!fault.empty()) gateway.status().remark(fault);
  gateway.status().publish();
  return fault.empty() ? 0 : 1;
}

int serve_unit(const Experiment& experiment, const LiveModbus& options, CanBus& bus,
               LcmLink& link) {
  ModbusUnitProcess unit(experiment, options.line, options.unit, options.is_in_step, bus, link);
  EventLoop loop;
  std::string fault;
  loop.watch(unit.line_descriptor(), [&] {
    try {
      unit.on_line();
    } catch (const JobError& error) {
      fault = error.what();
      loop.stop();
    }
  });
  loop.watch_bus(bus, [&] { unit.on_bus(); });
  loop.every(0.25, [&] { unit.publish_status(); });
  loop.on_stop_signal([&] { loop.stop(); });
  unit.status().set_state(ProcessState::kReady);
  unit.status().remark("answers on " + options.line);
  loop.run();
  unit.status().set_state(fault.empty() ? ProcessState::kFinished : ProcessState::kFailed);
  if (!fault.empty()) unit.status().remark(fault);
  unit.publish_status();
  return fault.empty() ? 0 : 1;
}

}  // namespace

int run_modbus(const Experiment& experiment, const LiveModbus& options, CanBus& bus,
               LcmLink& link) {
  return options.unit == 0 ? ask_units(experiment, options, bus, link)
                           : serve_unit(experiment, options, bus, link);
}

}  // namespace holdfast
