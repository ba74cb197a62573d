#pragma once

#include <string>

#include "common/lcm_link.h"
#include "drivers/can/can_bus.h"
#include "tools/experiment.h"

namespace holdfast {

/// A serial line, and what holdfast-modbus is to do on it.
struct LiveModbus {
  std::string line;         // as ModbusUrl has it
  int unit = 0;             // to be; 0: asks all units
  bool is_in_step = false;  // as a unit: the nth round of requests gets step n
};

/// Asks the units of the line in each step until the last one, or is one of them until it is
/// stopped. Returns the exit status: 0, or 1 when it was stopped before its last step, no unit ever
/// answered, frames were lost or the line went. Throws as ModbusGateway and ModbusUnitProcess.
int run_modbus(const Experiment& experiment, const LiveModbus& options, CanBus& bus, LcmLink& link);

}  // namespace holdfast
