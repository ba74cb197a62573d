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
  /// Throws UsageError when the scenario has no sensor on Modbus, or the line is none.
  ModbusGateway(const Experiment& experiment, const std::string& line, CanBus& bus, LcmLink& link);

  StatusReporter& status() { return status_; }
  /// Asks each unit once, sends its frame, then the tick where ticks end steps. False after the
  /// last step.
  bool take_step();

 private:
  ModbusAnswer ask(ModbusUnit& unit);
  void note(int unit, ModbusAnswer answer);

  const Experiment& experiment_;
  CanBus& bus_;
  StatusReporter status_;
  FrameCodec codec_;
  ModbusClient client_;
  std::vector<ModbusUnit> units_;
  std::vector<ModbusAnswer> last_answers_;
  std::vector<std::uint8_t> inputs_;
  std::vector<CanFrame> frames_;
  std::int64_t step_ = 1;
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
