#include "plant/truth_messages.h"

#include <holdfast/attack_signal_t.hpp>
#include <holdfast/known_input_t.hpp>
#include <holdfast/truth_t.hpp>

namespace holdfast {

void to_message(const PlantStep& step, std::int64_t utime, truth_t& message) {
  message.utime = utime;
  message.step = step.step;
  message.mode = step.mode;
  message.num_states = static_cast<std::int32_t>(step.state.size());
  message.state.assign(step.state.data(), step.state.data() + step.state.size());
  message.reading.clear();
  for (const auto& values : step.clean_readings) {
    message.reading.insert(message.reading.end(), values.begin(), values.end());
  }
  message.num_readings = static_cast<std::int32_t>(message.reading.size());
}

void to_message(const AttackSignal& signal, std::int64_t step, std::int64_t utime,
                attack_signal_t& message) {
  message.utime = utime;
  message.step = step;
  message.name = signal.name;
  message.num_values = static_cast<std::int32_t>(signal.value.size());
  message.value = signal.value;
}

bool to_message(const Eigen::VectorXd& input, std::int64_t step, std::int64_t utime,
                known_input_t& message) {
  if (input.size() == 0) return false;
  message.utime = utime;
  message.step = step;
  message.num_inputs = static_cast<std::int32_t>(input.size());
  message.input.assign(input.begin(), input.end());
  return true;
}

}  // namespace holdfast
