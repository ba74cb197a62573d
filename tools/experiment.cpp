#include "tools/experiment.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <set>

#include "drivers/can/can_bus.h"

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

// A believed value that is tied to the true one by the word "same", so that a sweep moves both.
void read_assumed(ConfigurationMap& map, const char* key, std::vector<double>& value,
                  const std::vector<double>& truth) {
  std::string text = "same";
  const bool is_same = !map.has(key) || (map.scalar_text(key, text) && text == "same");
  if (is_same) {
    map.read(key, text);
    value = truth;
  } else {
    map.read_shared(key, value, truth.size(), kProbability);
  }
}

// True for a rule that flips each frame of its messages with one probability, in every step.
bool flips_always(const AttackRule& rule) {
  const AttackWindow everywhere;
  return rule.bit < 0 && rule.match.signal.empty() &&
         rule.window.first_step == everywhere.first_step &&
         rule.window.last_step == everywhere.last_step && rule.window.from_s == everywhere.from_s &&
         rule.window.to_s == everywhere.to_s;
}

// Probability that a sensor's bit arrives inverted. A rule that flips only at times has none.
std::vector<double> true_flip_probability(const Experiment& experiment, std::string& untied_rule) {
  std::vector<double> flip(experiment.model.num_sensors(), 0.0);
  if (!experiment.has_bus()) return flip;  // no bus, no proxy: no rule acts
  for (const AttackRule& rule : experiment.rules) {
    if (rule.action != AttackRule::Action::kFlip) continue;
    if (!flips_always(rule)) untied_rule = rule.name;
    for (std::size_t s = 0; s < flip.size() && s < experiment.layout.messages.size(); ++s) {
      const DbcMessage* message = experiment.layout.dbc.find(experiment.layout.messages[s]);
      if (message == nullptr || !selects(rule.match, *message)) continue;
      flip[s] = flip[s] * (1.0 - rule.probability) + (1.0 - flip[s]) * rule.probability;
    }
  }
  return flip;
}

void read_assumes(ConfigurationMap map, const Experiment& experiment, EstimatorEntry& entry) {
  entry.assumes = experiment.plant.attack;
  read_assumed(map, "dos", entry.assumes.dos, experiment.plant.attack.dos);
  read_assumed(map, "deception", entry.assumes.deception, experiment.plant.attack.deception);
  std::string untied_rule, flip_text = "same";
  const std::vector<double> flip = true_flip_probability(experiment, untied_rule);
  const bool is_tied =
      !map.has("flip") || (map.scalar_text("flip", flip_text) && flip_text == "same");
  if (is_tied && !untied_rule.empty()) {
    map.problem("flip", "cannot be the same as rule '" + untied_rule +
                            "', which flips only at times; give a number");
  }
  read_assumed(map, "flip", entry.assumes.flip, flip);
  std::vector<double> range = {entry.assumes.deception_low, entry.assumes.deception_high};
  map.read("deception_range", range, 2);
  if (range.size() == 2 && range[0] < range[1]) {
    entry.assumes.deception_low = range[0];
    entry.assumes.deception_high = range[1];
  } else {
    map.problem("deception_range", "must be [low, high] with low < high");
  }
}

void read_estimators(ConfigurationMap& root, Experiment& experiment) {
  std::set<std::string> names;
  for (ConfigurationMap& map : root.maps("estimators")) {
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
    std::string method = "secure_particle_filter";
    map.read("method", method);
    if (method != "secure_particle_filter") {
      map.problem("method", "'" + method + "' is none of: secure_particle_filter");
    }
    map.read_choice(
        "input", entry.input,
        {{"received", EstimatorEntry::Input::kReceived}, {"clean", EstimatorEntry::Input::kClean}});
    entry.model = experiment.model;
    entry.model.read(map.map("model"));
    if (entry.model.num_sensors() != experiment.model.num_sensors()) {
      map.problem("model", "must have as many sensors as the plant's");
      continue;
    }
    read_assumes(map.map("assumes"), experiment, entry);
    entry.particle_filter.read(map);
    experiment.estimators.push_back(std::move(entry));
  }
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
  if (experiment.layout.messages.size() != experiment.model.num_sensors()) {
    map.problem("messages", std::to_string(experiment.layout.messages.size()) + " messages for " +
                                std::to_string(experiment.model.num_sensors()) + " sensors");
  }
  if (experiment.layout.signals.size() != 1)
    map.problem("signals", "a binary sensor has one signal");
}

void read_groups(ConfigurationMap& root, Experiment& experiment) {
  experiment.state_names =
      BinaryTargetPlant(experiment.model, experiment.plant, 0, 0).state_names();
  root.read("state_names", experiment.state_names);
  if (!root.has("state_groups")) {
    experiment.state_groups = {{"position", {0, 2}, "m", 20.0}, {"velocity", {1, 3}, "m/s", 0.0}};
  }
  for (ConfigurationMap& map : root.maps("state_groups")) {
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

  ConfigurationMap plant = root.map("plant");
  std::string kind = "binary_target";
  plant.read("kind", kind);
  if (kind != "binary_target") plant.problem("kind", "'" + kind + "' is none of: binary_target");
  if (plant.has("command")) plant.read("command", experiment.plant_command);
  experiment.model.read(plant.map("model"));
  experiment.plant.read(plant, experiment.model.num_sensors());

  read_network(root.map("network"), folder, experiment);
  experiment.assembler.num_steps = experiment.num_steps;
  experiment.assembler.step_s = experiment.model.step_s;
  experiment.rules = read_attack_rules(root, experiment.layout);
  read_estimators(root, experiment);
  read_groups(root, experiment);
  ConfigurationMap campaign = root.map("campaign");
  campaign.read("runs", experiment.campaign_runs, {1.0, 1e9});
  campaign.read("detection_threshold", experiment.detection_threshold, kProbability);
  experiment.sweep = read_sweep(campaign, "sweep");
  document.finish();
  experiment.resolved = document.resolved_text();
  return experiment;
}

}  // namespace

const EstimatorEntry& Experiment::estimator(const std::string& estimator_name) const {
  for (const EstimatorEntry& entry : estimators) {
    if (entry.name == estimator_name) return entry;
  }
  std::string names;
  for (const EstimatorEntry& entry : estimators) names += (names.empty() ? "" : ", ") + entry.name;
  throw UsageError("no estimator '" + estimator_name + "' in scenario " + name +
                   "; it has: " + names);
}

std::string Experiment::kernel_text() const {
  std::set<std::string> kernels;
  std::string list;
  for (const EstimatorEntry& entry : estimators) {
    if (entry.is_outside()) continue;
    const std::string& asked = entry.particle_filter.kernel;
    const std::string kernel = asked == "auto" ? particle_kernel_name() : asked;
    kernels.insert(kernel);
    list += (list.empty() ? "" : " ") + entry.name + "=" + kernel;
  }
  if (kernels.empty()) return particle_kernel_name();
  return kernels.size() == 1 ? *kernels.begin() : list;
}

std::unique_ptr<Plant> Experiment::make_plant(std::uint32_t run) const {
  return std::make_unique<BinaryTargetPlant>(model, plant, static_cast<std::uint64_t>(seed), run);
}

std::unique_ptr<Estimator> Experiment::make_estimator(const EstimatorEntry& entry,
                                                      std::uint32_t run) const {
  return std::make_unique<SecureParticleFilter>(entry.model, entry.assumes, entry.particle_filter,
                                                static_cast<std::uint64_t>(seed), run,
                                                "estimator/particles");
}

ProxyCore Experiment::make_proxy(std::uint32_t run) const {
  return ProxyCore(rules, layout, static_cast<std::uint64_t>(seed), run, model.step_s);
}

std::unique_ptr<RadioChannel> Experiment::make_radio_channel(std::uint32_t run) const {
  if (!model.has_radio_channel) return nullptr;
  return std::make_unique<RadioChannel>(model.radio_gain, model.radio_noise_std,
                                        static_cast<std::uint64_t>(seed), run);
}

Experiment load_experiment(const std::string& file, const std::vector<std::string>& overrides) {
  return read_experiment(ConfigurationDocument::from_file(file, overrides),
                         std::filesystem::path(file).parent_path().string());
}

Experiment experiment_from_text(const std::string& text, const std::string& place) {
  return read_experiment(ConfigurationDocument::from_text(text, place), "");
}

}  // namespace holdfast
