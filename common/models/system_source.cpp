#include "common/models/system_source.h"

#include <numeric>
#include <set>

#include "common/models/linear_model.h"

namespace holdfast {
namespace {

bool has_equal_matrices(const SystemModel& one, const SystemModel& other) {
  const auto is_equal = [](const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
    return a.rows() == b.rows() && a.cols() == b.cols() && a == b;
  };
  return is_equal(one.A, other.A) && is_equal(one.B, other.B) && is_equal(one.C, other.C) &&
         is_equal(one.D, other.D) && is_equal(one.G, other.G) && is_equal(one.H, other.H) &&
         is_equal(one.Q, other.Q) && is_equal(one.R, other.R);
}

// Topologies are the same plant, connected otherwise; each has a name of its own.
void check_alike(ConfigurationMap& map, const ModeSet& own) {
  const SystemModel& first = own.topologies.front();
  const char* key = map.has("ties") ? "ties" : "topologies";
  std::set<std::string> names;
  for (std::size_t i = 0; i < own.topologies.size(); ++i) {
    const SystemModel& other = own.topologies[i];
    if (!names.insert(own.topology_names[i]).second) {
      map.problem(key, "'" + own.topology_names[i] + "' given twice");
    }
    if (other.num_states() != first.num_states() ||
        other.num_measurements() != first.num_measurements() ||
        other.num_attack_channels() != first.num_attack_channels() ||
        other.num_inputs() != first.num_inputs() || other.step_s != first.step_s) {
      map.problem(key,
                  "must agree in step_s and in the numbers of states, measurements, attack "
                  "channels and known inputs");
    } else if (other.state_names != first.state_names ||
               other.measurement_names != first.measurement_names ||
               other.attack_names != first.attack_names || other.input_names != first.input_names) {
      map.problem(key, "must have the same names of states, measurements, channels and inputs");
    }
  }
}

}  // namespace

const std::vector<std::string>& SystemSource::kind_names() {
  static const std::vector<std::string> names = {"linear", "ieee14", "turning_target",
                                                 "three_area"};
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
  const SystemModel before = model;
  try {
    switch (kind) {
      case Kind::kLinear:
        read_linear_model(map, model);
        return set_topologies(map, before);
      case Kind::kIeee14:
        ieee14.read(map);
        model = make_ieee14_model(ieee14);
        break;
      case Kind::kTurningTarget:
        turning_target.read(map);
        model = make_turning_target_model(turning_target);
        break;
      case Kind::kThreeArea:
        three_area.read(map);
        model = make_three_area_model(three_area, three_area.ties.front());
        break;
    }
    set_topologies(map, before);
  } catch (const UsageError& error) {
    return map.problem("", error.what());
  }
  resolve_matrices(map, model);
}

void SystemSource::set_topologies(ConfigurationMap& map, const SystemModel& model_before) {
  ModeSet own;
  if (kind == Kind::kThreeArea) {
    own.topology_names = three_area.ties;
    for (const std::string& ties : three_area.ties) {
      own.topologies.push_back(make_three_area_model(three_area, ties));
    }
  } else if (kind == Kind::kLinear && map.has("topologies")) {
    for (ConfigurationMap& entry : map.maps("topologies")) {
      entry.require("name");
      entry.read("name", own.topology_names.emplace_back());
      read_linear_model(entry, own.topologies.emplace_back(model));
    }
  } else if (modes.topologies.size() > 1) {
    // A belief that says nothing new keeps the plant's.
    if (has_equal_matrices(model, model_before)) return;
    map.problem("topologies", "must be given again where the model differs from the plant's");
  }
  if (own.topologies.empty()) {
    if (map.has("topologies")) map.problem("topologies", "must name at least one topology");
    own.topologies = {model};
    own.topology_names = {"all"};
  }
  check_alike(map, own);
  // Modes name topologies and channels by their places: with other places they mean nothing.
  if (own.topology_names != modes.topology_names || modes.topologies.empty() ||
      own.topologies.front().attack_names != modes.topologies.front().attack_names) {
    modes.modes.clear();
  }
  modes.topologies = std::move(own.topologies);
  modes.topology_names = std::move(own.topology_names);
}

std::vector<SystemSource::Group> SystemSource::groups() const {
  std::vector<int> states(static_cast<std::size_t>(model.num_states()));
  std::iota(states.begin(), states.end(), 0);
  if (kind == Kind::kLinear) return {{"state", states, ""}};
  if (kind == Kind::kThreeArea) {
    return {{"state", states, ""},
            {"frequency", {0, 3, 6}, ""},
            {"mechanical", {1, 2, 4, 5, 7, 8}, ""},
            {"tie", {9, 10, 11}, ""}};
  }
  const auto half = states.begin() + static_cast<std::ptrdiff_t>(states.size() / 2);
  if (kind == Kind::kTurningTarget) {
    return {{"position", {states.begin(), half}, "m"}, {"velocity", {half, states.end()}, "m/s"}};
  }
  return {{"angle", {states.begin(), half}, "rad"}, {"frequency", {half, states.end()}, "rad/s"}};
}

}  // namespace holdfast
