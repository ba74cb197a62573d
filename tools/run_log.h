#pragma once

#include <cstdint>
#include <string>

#include "tools/experiment.h"

namespace holdfast {

/// Writes one run in process as a log: RUN_META, PLANT_TRUTH, MEASUREMENT, ATTACK_FRAME,
/// ATTACK_SIGNAL EST_<NAME> and SMOOTHED_<NAME>, as live processes publish them.
void write_run_log(const Experiment& experiment, std::uint32_t run, const std::string& file);

}  // namespace holdfast
