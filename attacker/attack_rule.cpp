#include "attacker/attack_rule.h"

#include <algorithm>
#include <limits>
#include <set>

#include "attacker/attack_action.h"
#include "common/name_list.h"

namespace holdfast {
namespace {

using Messages = std::vector<const DbcMessage*>;

struct ActionName {
  AttackRule::Action action;
  const char* name;
  const char* attack_class;  // what the truth calls it, unless the rule says something else
};

constexpr ActionName kActions[] = {{AttackRule::Action::kDrop, "drop", "suspension"},
                                   {AttackRule::Action::kFlip, "flip", "alteration"},
                                   {AttackRule::Action::kSubstitute, "substitute", "alteration"},
                                   {AttackRule::Action::kInject, "inject", "fabrication"},
                                   {AttackRule::Action::kForce, "force", "alteration"},
                                   {AttackRule::Action::kAdd, "add", "alteration"},
                                   {AttackRule::Action::kScale, "scale", "alteration"},
                                   {AttackRule::Action::kArm, "arm", ""},
                                   {AttackRule::Action::kBits, "bits", "alteration"},
                                   {AttackRule::Action::kFreeze, "freeze", "replay"},
                                   {AttackRule::Action::kDuplicate, "duplicate", "replay"},
                                   {AttackRule::Action::kDelay, "delay", "delay"},
                                   {AttackRule::Action::kMasquerade, "masquerade", "masquerade"}};

// A condition speaks of a frame that passes both rules; a forged one meets no rule.
bool can_be_named(const AttackRule& rule) {
  return rule.action != AttackRule::Action::kInject;
}

std::string list_of(const std::vector<AttackRule>& rules) {
  std::string list;
  for (const AttackRule& rule : rules) {
    if (can_be_named(rule)) list += (list.empty() ? "" : ", ") + rule.name;
  }
  return list.empty() ? "none" : list;
}

// Indices of the rules that a condition names: one name or a list.
std::vector<std::uint32_t> read_condition(ConfigurationMap& map, const char* key,
                                          const AttackRule& rule,
                                          const std::vector<AttackRule>& earlier) {
  std::vector<std::string> names;
  if (std::string one; map.scalar_text(key, one)) {
    map.read(key, one);
    names.push_back(one);
  } else {
    map.read(key, names);
  }
  std::vector<std::uint32_t> indices;
  const bool is_injection = rule.action == AttackRule::Action::kInject;
  for (const std::string& name : names) {
    const auto found = std::find_if(earlier.begin(), earlier.end(),
                                    [&](const AttackRule& it) { return it.name == name; });
    if (found == earlier.end()) {
      map.problem(key,
                  "no earlier rule is named '" + name + "'; earlier rules: " + list_of(earlier));
    } else if (!can_be_named(*found)) {
      map.problem(key, "'" + name + "' injects, and no frame that it forges meets another rule");
    } else if (is_injection && found->is_on_way_back) {
      map.problem(key, "'" + name + "' acts on commands, and in which step they come by is chance");
    } else if (!is_injection && found->is_on_way_back != rule.is_on_way_back) {
      map.problem(key, "'" + name + "' acts on frames that go the other way");
    } else {
      indices.push_back(static_cast<std::uint32_t>(found - earlier.begin()));
    }
  }
  return indices;
}

void read_conditions(ConfigurationMap& map, AttackRule& rule,
                     const std::vector<AttackRule>& earlier) {
  rule.given = read_condition(map, "given", rule, earlier);
  rule.unless = read_condition(map, "unless", rule, earlier);
  // Neither can ever hold: the rule would be dead without a word.
  for (const std::uint32_t index : rule.given) {
    const AttackRule& named = earlier[index];
    if (suspends(named) && rule.action != AttackRule::Action::kInject) {
      map.problem("given", "'" + named.name + "' drops, and no later rule meets those frames");
    }
    if (std::find(rule.unless.begin(), rule.unless.end(), index) != rule.unless.end()) {
      map.problem("unless", "'" + named.name + "' stands in given as well");
    }
  }
}

void read_direction(ConfigurationMap& match_map, const FrameLayout& layout, AttackRule& rule) {
  const std::vector<std::string>& names = rule.match.messages;
  const auto found = std::find(names.begin(), names.end(), layout.command.message);
  rule.is_on_way_back = layout.command.exists() && found != names.end();
  if (rule.is_on_way_back && names.size() > 1) {
    match_map.problem("messages", "'" + layout.command.message +
                                      "' goes to the plant, the others to the monitor: a rule for "
                                      "each way");
  }
}

// What a rule remembers goes by the proxy's steps, and commands belong to those that they name.
void check_way_back(ConfigurationMap& map, const AttackRule& rule) {
  if (!rule.is_on_way_back) return;
  if (replays(rule) || (is_over_time(rule) && rule.action != AttackRule::Action::kInject)) {
    map.problem("value", "commands are no readings: no waveform, walk or replay");
  }
  if (rule.action == AttackRule::Action::kFreeze)
    map.problem("action", "commands are no readings: none of them can stay as it was");
  if (rule.chain && rule.action != AttackRule::Action::kInject)
    map.problem("chain", "goes by the attacker's steps, and commands belong to those they name");
}

void read_action_name(ConfigurationMap& map, AttackRule::Action& action) {
  std::string name = to_string(action);
  map.read("action", name);
  std::vector<std::string> names;
  for (const ActionName& it : kActions) {
    names.emplace_back(it.name);
    if (name == it.name) action = it.action;
  }
  if (name != to_string(action))
    map.problem("action", "'" + name + "' is none of: " + name_list(names));
}

// On which of the frames that it might act on: each n-th, with one probability or in bursts.
void read_frequency(ConfigurationMap& map, AttackRule& rule) {
  map.read("every", rule.every, {1.0, 1e9});
  if (!map.has("chain")) {
    map.read("probability", rule.probability, kProbability);
    return;
  }
  if (map.has("probability")) {
    map.problem("probability", "the chain says it: chain.in_bad and chain.in_good");
    map.read("probability", rule.probability, kProbability);
  }
  ConfigurationMap chain = map.map("chain");
  rule.chain.emplace();
  chain.require("to_bad");
  chain.require("to_good");
  chain.read("to_bad", rule.chain->to_bad, kProbability);
  chain.read("to_good", rule.chain->to_good, kProbability);
  chain.read("in_bad", rule.chain->in_bad, kProbability);
  chain.read("in_good", rule.chain->in_good, kProbability);
}

// A substitution or forgery of earlier values is a replay, whatever writes it.
void read_class(ConfigurationMap& map, AttackRule& rule) {
  for (const ActionName& it : kActions) {
    if (it.action == rule.action)
      rule.attack_class = replays(rule) && rule.action != AttackRule::Action::kMasquerade
                              ? "replay"
                              : it.attack_class;
  }
  if (rule.action == AttackRule::Action::kArm || !map.has("class")) return;
  map.read_choice("class", rule.attack_class,
                  {{"alteration", std::string("alteration")},
                   {"fabrication", std::string("fabrication")},
                   {"suspension", std::string("suspension")},
                   {"masquerade", std::string("masquerade")},
                   {"replay", std::string("replay")},
                   {"delay", std::string("delay")}});
}

void read_energy(ConfigurationMap& map, AttackRule& rule) {
  if (!map.has("energy")) return;
  ConfigurationMap energy = map.map("energy");
  energy.require("budget");
  energy.read("budget", rule.energy.budget, {0.0, std::numeric_limits<double>::max()});
  energy.read("refill_per_step", rule.energy.refill_per_step,
              {0.0, std::numeric_limits<double>::max()});
  if (rule.action == AttackRule::Action::kArm)
    map.problem("energy", "to arm other rules costs nothing");
  using Action = AttackRule::Action;
  const bool writes = rule.action == Action::kSubstitute || rule.action == Action::kForce ||
                      rule.action == Action::kAdd || rule.action == Action::kScale;
  if (!writes && rule.energy.budget < 1.0)
    energy.problem("budget", "each frame costs 1: the rule would never act");
}

// It takes the place of a sender, whole, for as long as its window lasts.
void check_masquerade(ConfigurationMap& map, const AttackRule& rule) {
  if (rule.action != AttackRule::Action::kMasquerade) return;
  const std::pair<const char*, bool> narrowed[] = {{"every", rule.every != 1},
                                                   {"times", map.has("times")},
                                                   {"probability", rule.probability != 1.0},
                                                   {"chain", rule.chain.has_value()},
                                                   {"given", !rule.given.empty()},
                                                   {"unless", !rule.unless.empty()},
                                                   {"energy", rule.energy.is_limited()}};
  for (const auto& [key, is_narrowed] : narrowed) {
    if (is_narrowed) map.problem(key, "a masquerade takes all of a sender's frames; use window");
  }
  if (!rule.match.signal.empty() || !rule.match.payload.value.empty() ||
      rule.match.type != AttackMatch::Type::kAny)
    map.problem("match", "a masquerade takes all frames of its messages, whatever they hold");
  if (rule.is_on_way_back)
    map.problem("action", "commands come when an operator wants, and have no pace to learn");
}

AttackRule read_rule(ConfigurationMap map, const FrameLayout& layout, const std::string& folder,
                     const std::vector<AttackRule>& earlier) {
  using Action = AttackRule::Action;
  AttackRule rule;
  map.require("name");
  map.read("name", rule.name);
  map.require("action");
  read_action_name(map, rule.action);
  ConfigurationMap match_map = map.map("match");
  const Messages selected = read_match(match_map, rule.match, layout);
  const std::pair<const char*, bool> compared[] = {
      {"signal", !rule.match.signal.empty()},
      {"type", rule.match.type != AttackMatch::Type::kAny},
      {"payload", !rule.match.payload.value.empty()}};
  for (const auto& [key, is_compared] : compared) {
    if (rule.action == Action::kInject && is_compared)
      match_map.problem(key, "an injection compares nothing: there is no frame yet");
  }
  read_direction(match_map, layout, rule);
  rule.window.read(map.map("window"));
  if (map.has("times")) map.read("times", rule.times, {1.0, 1e15});
  read_frequency(map, rule);
  map.read_choice("draw", rule.draw,
                  {{"frame", AttackRule::Draw::kFrame}, {"step", AttackRule::Draw::kStep}});
  read_conditions(map, rule, earlier);
  read_action(map, folder, layout, selected, rule);
  read_class(map, rule);
  read_energy(map, rule);
  check_masquerade(map, rule);
  const bool touches = rule.action != Action::kDrop && rule.action != Action::kArm &&
                       rule.action != Action::kDuplicate && rule.action != Action::kDelay;
  if (touches) map.read("repair", rule.repairs);
  check_way_back(map, rule);
  return rule;
}

}  // namespace

const char* to_string(AttackRule::Action action) {
  for (const ActionName& it : kActions) {
    if (it.action == action) return it.name;
  }
  return "unknown";
}

std::optional<CanFrame> frame_to_forge(const AttackRule& rule, const DbcMessage& message) {
  std::optional<std::vector<DbcSignal>> carried = find_signals(message, rule.signals);
  if (!carried) return std::nullopt;
  const DbcSignal* counter = message.find(rule.counter_signal);
  if (counter != nullptr && rule.action == AttackRule::Action::kInject)
    carried->push_back(*counter);
  const std::optional<CanFrame> form = message.frame_for(*carried);
  if (!form || rule.values.empty() ||
      rule.values.front().kind != ValueDistribution::Kind::kConstant)
    return form;
  CanFrame written = *form;
  for (std::size_t i = 0; i < rule.values.size(); ++i)
    (*carried)[i].pack({written.data.data(), written.num_bytes}, rule.values[i].value);
  const bool carries_all = std::ranges::all_of(
      *carried, [&](const DbcSignal& signal) { return message.carries(signal, written.bytes()); });
  return carries_all ? form : std::nullopt;
}

std::vector<AttackRule> read_attack_rules(ConfigurationMap parent, const FrameLayout& layout,
                                          const std::string& folder) {
  std::vector<AttackRule> rules;
  std::set<std::string> names;
  for (ConfigurationMap map : parent.maps("attacks", AttackRule::kRulesMax)) {
    rules.push_back(read_rule(map, layout, folder, rules));
    const std::string& name = rules.back().name;
    if (map.has("name") && name.empty()) map.problem("name", "must not be empty");
    if (!name.empty() && !names.insert(name).second)
      map.problem("name", "'" + name + "' given twice");
  }
  return rules;
}

}  // namespace holdfast
