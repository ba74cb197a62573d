#include "common/models/system_source.h"

#include <numeric>

#include "common/models/linear_model.h"

namespace holdfast {

const std::vector<std::string>& SystemSource::kind_names() {
  static const std::vector<std::string> names = {"linear", "ieee14", "turning_target"};
  return names;
}

bool SystemSource::set_kind(const std::string& name) {
  for (std::size_t i = 0; i < kind_names().size(); ++i) {
    if (kind_names()[i] != name) continue;
    kind = static_cast<Kind>(i);
    return true;
  }
  return false;
}

void SystemSource::read(ConfigurationMap map) {
  try {
    switch (kind) {
      case Kind::kLinear:
        return read_linear_model(map, model);
      case Kind::kIeee14:
        ieee14.read(map);
        model = make_ieee14_model(ieee14);
        break;
      case Kind::kTurningTarget:
        turning_target.read(map);
        model = make_turning_target_model(turning_target);
        break;
    }
  } catch (const UsageError& error) {
    return map.problem("", error.what());
  }
  resolve_matrices(map, model);
}

std::vector<SystemSource::Group> SystemSource::groups() const {
  std::vector<int> states(static_cast<std::size_t>(model.num_states()));
  std::iota(states.begin(), states.end(), 0);
  if (kind == Kind::kLinear) return {{"state", states, ""}};
  const auto half = states.begin() + static_cast<std::ptrdiff_t>(states.size() / 2);
  if (kind == Kind::kTurningTarget) {
    return {{"position", {states.begin(), half}, "m"}, {"velocity", {half, states.end()}, "m/s"}};
  }
  return {{"angle", {states.begin(), half}, "rad"}, {"frequency", {half, states.end()}, "rad/s"}};
}

}  // namespace holdfast
