#pragma once

#include "attacker/rule_effects.h"
#include "drivers/can/frame_codec.h"
#include "tools/plant_setup.h"

namespace holdfast {

/// The Kalman filter that an attacker runs in the monitor's place (extended for a nonlinear plant;
/// of the first topology, no attack assumed), fed with every reading that he lets through, each
/// message by itself: noise between the readings of two messages is taken to be uncorrelated.
/// Forgeries and copies do not reach it. Starts as the plant's start says. Precondition: the layout
/// fits the plant.
MonitorModel make_monitor_model(const SystemSetup& plant, const FrameLayout& layout);

}  // namespace holdfast
