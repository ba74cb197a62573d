#include "tools/experiment.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <set>

#include "common/configuration_text.h"
#include "common/name_list.h"
#include "drivers/can/can_bus.h"
#include "tools/monitor_filter.h"

namespace holdfast {
namespace {

constexpr std::int64_t kSchemaVersion = 1;

void check_name(ConfigurationMap& map, const std::string& name) {
  const bool fits = !name.empty() && name.size() <= 40 &&
                    std::all_of(name.begin(), name.end(), [](unsigned char c) {
                      return std::islower(c) != 0 || std::isdigit(c) != 0 || c == '_';
                    });
  if (!fits)
    map.problem("name", "'" + name + "' must be lower-case letters, digits and '_', at most 40");
}

void read_estimators(ConfigurationMap& root, Experiment& experiment) {
  std::set<std::string> names;
  const std::vector<AttackRule> no_rules;  // no bus, no proxy: no rule acts
  const MethodContext context{experiment.plant, experiment.layout,
                              experiment.has_bus() ? experiment.rules : no_rules};
  for (ConfigurationMap& map : root.maps("estimators", kListedMax)) {
    EstimatorEntry entry;
    map.require("name");
    map.read("name", entry.name);
    check_name(map, entry.name);
    if (entry.name == "plant" || entry.name == "driver" || entry.name == "attacker") {
      map.problem("name", "'" + entry.name + "' is the name of another process of the run");
    }
    if (!names.insert(entry.name).second) map.problem("name", "'" + entry.name + "' is taken");
    if (map.has("command")) {
      map.read("command", entry.command);
      if (entry.command.empty()) map.problem("command", "must not be empty");
      experiment.estimators.push_back(std::move(entry));
      continue;
    }
    read_method(map, context, entry);
    if (entry.is_smoothed && !names.insert(entry.smoothed_name()).second) {
      map.problem("smoother", "'" + entry.smoothed_name() + "' is taken");
    }
    experiment.estimators.push_back(std::move(entry));
  }
}

void read_commands(ConfigurationMap& network, Experiment& experiment) {
  CommandLayout& layout = experiment.layout.command;
  layout.mode_names = experiment.plant.mode_names();
  if (layout.exists() && layout.mode_names.size() < 2) {
    network.problem("command", "the plant has no modes to switch between");
  }
  for (ConfigurationMap& map : network.maps("commands")) {
    OperatorCommand command;
    std::int64_t lead_steps = CommandLayout::kLeadSteps;
    map.require("after_step");
    map.read("after_step", command.after_step, {1.0, 1e9});
    command.change.mode = read_name(map, "mode", "the plant's modes", layout.mode_names);
    map.read("lead_steps", lead_steps, {1.0, 1e6});
    command.change.from_step = command.after_step + lead_steps;
    experiment.commands.push_back(command);
  }
  if (!experiment.commands.empty() && !layout.exists()) {
    network.problem("commands", "needs the key command: which message carries them");
  }
}

// The command's signals must hold every mode and step of the run.
void check_command_range(ConfigurationMap& network, const Experiment& experiment) {
  const CommandLayout& layout = experiment.layout.command;
  const DbcMessage* message = experiment.layout.dbc.find(layout.message);
  if (!layout.exists() || message == nullptr) return;
  const auto check = [&](const std::string& name, double largest) {
    const DbcSignal* signal = message->find(name);
    if (signal == nullptr || std::ldexp(1.0, signal->num_bits) > largest) return;
    network.problem("command", "signal '" + name + "' has " + std::to_string(signal->num_bits) +
                                   " bits, too few for " +
                                   std::to_string(static_cast<std::int64_t>(largest)));
  };
  check(layout.mode_signal, static_cast<double>(layout.mode_names.size()) - 1.0);
  std::int64_t last_step = experiment.num_steps;
  for (const OperatorCommand& command : experiment.commands)
    last_step = std::max(last_step, command.change.from_step);
  for (const AttackRule& rule : experiment.rules) {
    const bool forges = rule.is_on_way_back && rule.action == AttackRule::Action::kInject;
    const std::int64_t last_sent = std::min(experiment.num_steps, rule.window.last_step);
    if (forges) last_step = std::max(last_step, last_sent + rule.counter_offset);
  }
  check(layout.step_signal, static_cast<double>(last_step));
}

void read_network(ConfigurationMap map, const std::string& folder, Experiment& experiment) {
  map.read("sensor_bus", experiment.sensor_bus);
  map.read("monitor_bus", experiment.monitor_bus);
  if ((experiment.sensor_bus == "none") != (experiment.monitor_bus == "none")) {
    map.problem("monitor_bus", "'none' must stand for both buses or for neither");
  }
  if (canonical_bus_url(experiment.sensor_bus) == canonical_bus_url(experiment.monitor_bus) &&
      experiment.sensor_bus != "auto" && experiment.sensor_bus != "none") {
    map.problem("monitor_bus", "must be another bus than sensor_bus, else frames run in circles");
  }
  experiment.layout.read(map, folder);
  map.read("record_frames", experiment.record_frames);
  std::string close = "tick";
  map.read_choice("close_step", close,
                  {{"tick", std::string("tick")}, {"clock", std::string("clock")}});
  std::string check = close == "clock" ? "ignore" : "match";
  map.read_choice("counter_check", check,
                  {{"match", std::string("match")}, {"ignore", std::string("ignore")}});
  if (close == "clock" && check == "match") {
    map.problem(
        "counter_check",
        "a driver that closes steps by its own clock cannot know the sensors' step: 'ignore' it");
  }
  experiment.assembler.check_counter = check == "match";
  experiment.assembler.closed_by_tick = close == "tick";
  experiment.plant.take_layout(experiment.layout, map);
  read_commands(map, experiment);
}

void read_groups(ConfigurationMap& root, Experiment& experiment) {
  experiment.state_names = experiment.plant.state_names();
  root.read("state_names", experiment.state_names);
  if (!root.has("state_groups")) experiment.state_groups = experiment.plant.default_groups();
  for (ConfigurationMap& map : root.maps("state_groups", kListedMax)) {
    StateGroup group;
    std::vector<double> states;
    map.require("name");
    map.read("name", group.name);
    check_name(map, group.name);
    map.require("states");
    map.read("states", states, 0, {0.0, static_cast<double>(experiment.state_names.size()) - 1.0});
    for (const double state : states) {
      if (state != static_cast<int>(state)) map.problem("states", "must be whole numbers, from 0");
      group.states.push_back(static_cast<int>(state));
    }
    std::sort(states.begin(), states.end());
    if (states.empty() || std::adjacent_find(states.begin(), states.end()) != states.end()) {
      map.problem("states", "must name each state once, and at least one");
    }
    for (const StateGroup& other : experiment.state_groups) {
      if (other.name == group.name) map.problem("name", "'" + group.name + "' is taken");
    }
    map.read("unit", group.unit);
    map.read("lost_above", group.lost_above, kNonNegative);
    experiment.state_groups.push_back(std::move(group));
  }
  YAML::Node list(YAML::NodeType::Sequence);
  for (const StateGroup& group : experiment.state_groups) {
    YAML::Node node;
    node["name"] = group.name;
    node["states"] = group.states;
    node["states"].SetStyle(YAML::EmitterStyle::Flow);
    node["unit"] = group.unit;
    node["lost_above"] = group.lost_above;
    list.push_back(node);
  }
  root.resolve("state_groups", list);
}

void read_windows(ConfigurationMap& campaign, Experiment& experiment) {
  for (ConfigurationMap& map : campaign.maps("windows", kListedMax)) {
    MetricsWindow window;
    window.last_step = experiment.num_steps;
    map.require("name");
    map.read("name", window.name);
    check_name(map, window.name);
    for (const MetricsWindow& other : experiment.windows) {
      if (other.name == window.name) map.problem("name", "'" + window.name + "' is taken");
    }
    map.read("first_step", window.first_step, {1.0, 1e9});
    map.read("last_step", window.last_step, {1.0, 1e9});
    if (window.last_step < window.first_step) map.problem("last_step", "lies before first_step");
    map.read("fresh_steps", window.fresh_steps, {-1.0, 1e6});
    for (ConfigurationMap& gap : map.maps("without", kListedMax)) {
      std::int64_t first = 1, last = 1;
      gap.require("first_step");
      gap.read("first_step", first, {1.0, 1e9});
      gap.require("last_step");
      gap.read("last_step", last, {1.0, 1e9});
      if (last < first) gap.problem("last_step", "lies before first_step");
      window.without.emplace_back(first, last);
    }
    experiment.windows.push_back(window);
  }
}

void check_stealth(ConfigurationMap& root, const Experiment& experiment) {
  for (const AttackRule& rule : experiment.rules) {
    const std::string fault = stealth_fault(rule, experiment);
    if (!fault.empty()) root.problem("attacks", "rule '" + rule.name + "': " + fault);
  }
}

Experiment read_experiment(ConfigurationDocument document, const std::string& folder) {
  Experiment experiment;
  ConfigurationMap root = document.root();
  std::int64_t schema = 0;
  root.require("holdfast");
  root.read("holdfast", schema, {1.0, static_cast<double>(kSchemaVersion)});
  root.require("name");
  root.read("name", experiment.name);
  check_name(root, experiment.name);
  root.read("description", experiment.description);
  root.read("seed", experiment.seed, kNonNegative);
  root.read("steps", experiment.num_steps, {1.0, 1e9});
  root.read("period_s", experiment.period_s, kNonNegative);

  experiment.plant.read(root.map("plant"), folder);
  if (!experiment.plant.is_usable()) {
    // What stands on a broken model would only repeat its problems.
    for (const char* key :
         {"network", "attacks", "estimators", "state_names", "state_groups", "campaign"})
      root.raw(key);
    document.finish();
  }
  read_network(root.map("network"), folder, experiment);
  experiment.assembler.num_steps = experiment.num_steps;
  experiment.assembler.step_s = experiment.step_s();
  experiment.rules = read_attack_rules(root, experiment.layout, folder);
  check_stealth(root, experiment);
  ConfigurationMap network = root.map("network");
  check_command_range(network, experiment);
  read_estimators(root, experiment);
  read_groups(root, experiment);
  ConfigurationMap campaign = root.map("campaign");
  campaign.read("runs", experiment.campaign_runs, {1.0, 1e9});
  campaign.read("detection_threshold", experiment.detection_threshold, kProbability);
  // Where packets are injected at every step, only the signal attack is what a detector looks for.
  if (experiment.plant.has_vector_readings()) experiment.attack_truth = AttackTruth::kSignals;
  campaign.read_choice("attack_truth", experiment.attack_truth,
                       {{"any", AttackTruth::kAny},
                        {"signals", AttackTruth::kSignals},
                        {"frames", AttackTruth::kFrames}});
  read_windows(campaign, experiment);
  campaign.read("mode_hold_steps", experiment.mode_hold_steps, {1.0, 1e6});
  experiment.sweep = read_sweep(campaign, "sweep");
  document.finish();
  experiment.resolved = document.resolved_text();
  return experiment;
}

}  // namespace

std::string stealth_fault(const AttackRule& rule, const Experiment& experiment) {
  if (!is_stealthy(rule)) return "";
  if (experiment.plant.system() == nullptr || !experiment.plant.command.empty()) {
    return "stealth needs a plant with vector readings that Holdfast simulates: the attacker runs "
           "a Kalman filter of it";
  }
  const FrameLayout& layout = experiment.layout;
  for (const std::string& signal : rule.signals) {
    if (std::ranges::find(layout.signals, signal) == layout.signals.end())
      return "stealth: '" + signal + "' is none of network.signals, so no filter reads it";
  }
  for (const DbcMessage& message : layout.dbc.messages) {
    const bool is_read = std::ranges::find(layout.messages, message.name) != layout.messages.end();
    if (!is_read && can_select(rule.match, message, layout) &&
        message.find(rule.signals.front()) != nullptr) {
      return "stealth: message '" + message.name +
             "' is none of network.messages, so no filter reads it";
    }
  }
  return "";
}

std::vector<std::string> Experiment::scored_names() const {
  std::vector<std::string> scored;
  for (const EstimatorEntry& entry : estimators) {
    if (entry.is_outside()) continue;
    scored.push_back(entry.name);
    if (entry.is_smoothed) scored.push_back(entry.smoothed_name());
  }
  return scored;
}

const EstimatorEntry* Experiment::find_estimator(const std::string& estimator_name) const {
  for (const EstimatorEntry& entry : estimators) {
    if (entry.name == estimator_name) return &entry;
  }
  return nullptr;
}

const EstimatorEntry& Experiment::estimator(const std::string& estimator_name) const {
  if (const EstimatorEntry* entry = find_estimator(estimator_name)) return *entry;
  std::string names;
  for (const EstimatorEntry& entry : estimators) names += (names.empty() ? "" : ", ") + entry.name;
  throw UsageError("no estimator '" + estimator_name + "' in scenario " + name +
                   "; it has: " + names);
}

Eigen::VectorXd Experiment::known_input(std::int64_t step) const {
  const SystemSetup* system = plant.system();
  if (system == nullptr || system->model().num_inputs() == 0) return {};
  return system->options.input(step, system->model());
}

std::string Experiment::kernel_text() const {
  std::set<std::string> kernels;
  std::string list;
  for (const EstimatorEntry& entry : estimators) {
    if (entry.is_outside()) continue;
    kernels.insert(entry.kernel);
    list += (list.empty() ? "" : " ") + entry.name + "=" + entry.kernel;
  }
  if (kernels.empty()) return particle_kernel_name();
  return kernels.size() == 1 ? *kernels.begin() : list;
}

std::unique_ptr<Plant> Experiment::make_plant(std::uint32_t run) const {
  return plant.make(static_cast<std::uint64_t>(seed), run);
}

std::unique_ptr<Estimator> Experiment::make_estimator(const EstimatorEntry& entry,
                                                      std::uint32_t run) const {
  return entry.make(static_cast<std::uint64_t>(seed), run);
}

ProxyCore Experiment::make_proxy(std::uint32_t run, bool may_change) const {
  const bool has_stealth = std::ranges::any_of(rules, is_stealthy) ||
                           (may_change && plant.system() != nullptr && plant.command.empty());
  return ProxyCore(rules, layout, static_cast<std::uint64_t>(seed), run, step_s(),
                   has_stealth ? make_monitor_model(*plant.system(), layout) : MonitorModel{});
}

std::unique_ptr<RadioChannel> Experiment::make_radio_channel(std::uint32_t run) const {
  const BinaryTargetSetup* target = plant.binary_target();
  if (target == nullptr || !target->model.has_radio_channel) return nullptr;
  return std::make_unique<RadioChannel>(target->model.radio_gain, target->model.radio_noise_std,
                                        static_cast<std::uint64_t>(seed), run);
}

Experiment load_experiment(const std::string& file, const std::vector<std::string>& overrides) {
  Experiment experiment = read_experiment(ConfigurationDocument::from_file(file, overrides),
                                          std::filesystem::path(file).parent_path().string());
  check_num_values(experiment.resolved, file + ", with its defaults");
  return experiment;
}

Experiment experiment_from_text(const std::string& text, const std::string& place) {
  ConfigurationDocument document = ConfigurationDocument::from_text(text, place);
  document.forbid_files();
  return read_experiment(std::move(document), "");
}

}  // namespace holdfast
