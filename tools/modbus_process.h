#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/status.h"
#include "drivers/can/can_bus.h"
#include "drivers/sensors/modbus_units.h"
#include "tools/experiment.h"

namespace holdfast {

/// What holdfast-modbus does: asks the units of a serial line in each step, and tells what they say
/// on a CAN bus.
class ModbusGateway {
 public:
  /// Throws UsageError when the scenario has no sensor on Modbus, or the line is none; JobError
  /// when it cannot be opened.
  ModbusGateway(const Experiment& experiment, const std::string& line, CanBus& bus, LcmLink& link);

  StatusReporter& status() { return status_; }
  /// Makes the next request. After the last one of a step, and then it returns true, it sends each
  /// unit's frame, and the tick where ticks end steps. Precondition: not is_finished(), and the
  /// line was idle for its gap.
  bool ask_next();
  double gap_s() const { return gap_s_; }
  /// True after the last step.
  bool is_finished() const { return step_ > experiment_.num_steps; }
  /// What went so wrong that the run is worth nothing; empty when nothing did.
  std::string fault() const;

 private:
  ModbusAnswer ask(const ModbusUnit& unit, const ModbusRequest& request);
  void end_unit();
  void end_step();

  const Experiment& experiment_;
  CanBus& bus_;
  StatusReporter status_;
  FrameCodec codec_;
  double gap_s_;
  ModbusClient client_;
  std::vector<ModbusUnit> units_;
  std::vector<ModbusAnswer> told_;  // of each unit: what was said of it last
  std::vector<std::uint8_t> inputs_;
  std::vector<CanFrame> frames_;
  std::int64_t step_ = 1;
  std::size_t unit_ = 0, request_ = 0;                 // to be asked next
  ModbusAnswer last_failure_ = ModbusAnswer::kInputs;  // of this unit in this step
  std::int64_t num_answers_ = 0;
};

/// What holdfast-modbus --serve does: answers as one unit what frames of a simulated plant tell.
class ModbusUnitProcess {
 public:
  /// Throws as the gateway, JobError when the line cannot be opened.
  ModbusUnitProcess(const Experiment& experiment, const std::string& line, int unit,
                    bool is_in_step, CanBus& bus, LcmLink& link);

  StatusReporter& status() { return status_; }
  int line_descriptor() const { return server_.file_descriptor(); }
  void on_bus();
  void on_line();
  void publish_status();

 private:
  void reply();

  CanBus& bus_;
  StatusReporter status_;
  FrameCodec codec_;
  ModbusTwin twin_;
  ModbusServer server_;
  std::optional<int> asked_;  // and not answered yet
};

}  // namespace holdfast
