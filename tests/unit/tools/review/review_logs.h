#pragma once

#include <algorithm>
#include <fstream>
#include <holdfast/attack_frame_t.hpp>
#include <holdfast/can_frames_t.hpp>
#include <holdfast/estimate_t.hpp>
#include <holdfast/measurement_set_t.hpp>
#include <holdfast/run_meta_t.hpp>
#include <holdfast/status_t.hpp>
#include <holdfast/timing_t.hpp>
#include <holdfast/truth_t.hpp>
#include <string>
#include <vector>

#include "common/log_file.h"
#include "common/run_meta.h"
#include "tests/support/temporary_folder.h"
#include "tools/log_review.h"

namespace holdfast::review_test {

using testing::TemporaryFolder;

inline bool has_warning(const RunReview& review, const std::string& part) {
  return std::ranges::any_of(review.warnings, [&](const std::string& warning) {
    return warning.find(part) != std::string::npos;
  });
}

inline std::string read_file(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

inline void write_file(const std::string& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary) << bytes;
}

inline const std::string kScenario = R"(holdfast: 1
name: hand_made
steps: 4
state_names: [x_position_m, x_velocity_mps, y_position_m, y_velocity_mps]
state_groups:
  - {name: position, states: [0, 2], unit: m}
  - {name: velocity, states: [1, 3], unit: m/s}
estimators:
  - {name: secure}
  - {name: neglect}
  - {name: uncorrupted, input: clean}
plant: {model: {sensor_positions_m: [[0, 0], [10, 5]]}}
)";

inline void write_meta(LogWriter& log, const std::string& scenario = kScenario) {
  RunMeta meta;
  meta.name = "hand_made";
  meta.scenario = scenario;
  meta.seed = 7;
  run_meta_t message = to_message(meta);
  log.write_message("RUN_META", 0, message);
}

inline void write_truth(LogWriter& log, std::int64_t step, const std::vector<double>& state) {
  truth_t message{};
  message.step = step;
  message.state = state;
  message.num_states = static_cast<std::int32_t>(state.size());
  log.write_message("PLANT_TRUTH", 0, message);
}

inline estimate_t make_estimate(std::int64_t step, const std::vector<double>& mean,
                                const std::vector<double>& covariance = {}) {
  estimate_t message{};
  message.step = step;
  message.attack_probability = -1.0;
  message.input_step = -1;
  message.mean = mean;
  message.num_states = static_cast<std::int32_t>(mean.size());
  message.covariance = covariance;
  message.num_covariance = static_cast<std::int32_t>(covariance.size());
  return message;
}

inline void write_estimate(LogWriter& log, const std::string& channel, std::int64_t step,
                           const std::vector<double>& mean,
                           const std::vector<double>& covariance = {}) {
  estimate_t message = make_estimate(step, mean, covariance);
  log.write_message(channel, 0, message);
}

inline void write_status(LogWriter& log, const std::string& name, std::int32_t state,
                         const std::vector<std::pair<std::string, std::int64_t>>& counters) {
  status_t message{};
  message.name = name;
  message.state = state;
  message.step = 3;
  for (const auto& [counter, value] : counters) {
    message.counter_name.push_back(counter);
    message.counter_value.push_back(value);
  }
  message.num_counters = static_cast<std::int32_t>(counters.size());
  std::string channel = "STATUS_";
  for (const char c : name)
    channel += static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  log.write_message(channel, 0, message);
}

inline can_frame_t make_frame(std::int64_t index, std::int32_t identifier,
                              const std::vector<std::uint8_t>& data) {
  can_frame_t frame{};
  frame.index = index;
  frame.identifier = identifier;
  frame.data = data;
  frame.num_bytes = static_cast<std::int32_t>(data.size());
  return frame;
}

inline void write_frames(LogWriter& log, const std::string& channel,
                         const std::vector<can_frame_t>& frames) {
  can_frames_t message{};
  message.frames = frames;
  message.num_frames = static_cast<std::int32_t>(frames.size());
  log.write_message(channel, 0, message);
}

inline attack_frame_t make_attack(std::int32_t disposition, std::int64_t tx_index,
                                  const std::string& rule) {
  attack_frame_t message{};
  message.disposition = disposition;
  message.tx_index = tx_index;
  message.rule = rule;
  message.action = "flip";
  return message;
}

}  // namespace holdfast::review_test
