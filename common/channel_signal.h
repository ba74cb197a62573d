#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "common/configuration.h"
#include "common/step_window.h"
#include "common/waveform.h"

namespace holdfast {

/// One signal of a channel: an attack on a plant, or a known input.
struct ChannelSignal {
  int channel = 0;
  StepWindow window;
  Waveform waveform;  // begins with the first step of the window
};

/// The list below the key: {channel, window, waveform ...}; names: of the channels, whose kind
/// (`what`, "the plant's attack channels") is told where a name is wrong. folder: of the scenario.
/// may_walk: see Waveform.
std::vector<ChannelSignal> read_channel_signals(ConfigurationMap& map, const char* key,
                                                const char* what,
                                                const std::vector<std::string>& names,
                                                const std::string& folder, bool may_walk = false);

/// Adds the signals that act in a step of step_s each to the channels' values. walks: one for each
/// signal, see Waveform; may be left out, then every walk stands at its start.
void add_signals(const std::vector<ChannelSignal>& signals, std::int64_t step, double step_s,
                 Eigen::VectorXd& values, std::span<const double> walks = {});

}  // namespace holdfast
