#include "common/channel_signal.h"

#include <algorithm>

#include "common/name_list.h"

namespace holdfast {

std::vector<ChannelSignal> read_channel_signals(ConfigurationMap& map, const char* key,
                                                const char* what,
                                                const std::vector<std::string>& names,
                                                const std::string& folder, bool may_walk) {
  std::vector<ChannelSignal> signals;
  for (ConfigurationMap& entry : map.maps(key)) {
    ChannelSignal signal;
    signal.channel = std::max(0, read_name(entry, "channel", what, names));
    signal.window.read(entry.map("window"));
    signal.waveform.read(entry, folder, may_walk);
    signals.push_back(std::move(signal));
  }
  return signals;
}

void add_signals(const std::vector<ChannelSignal>& signals, std::int64_t step, double step_s,
                 Eigen::VectorXd& values, std::span<const double> walks) {
  for (std::size_t i = 0; i < signals.size(); ++i) {
    const ChannelSignal& signal = signals[i];
    if (!signal.window.contains(step, step_s)) continue;
    values[signal.channel] += signal.waveform.value(step - signal.window.first(step_s), step_s,
                                                    walks.empty() ? 0.0 : walks[i]);
  }
}

}  // namespace holdfast
