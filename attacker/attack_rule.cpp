#include "attacker/attack_rule.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "common/name_list.h"

namespace holdfast {
namespace {

constexpr Interval kFinite{std::numeric_limits<double>::lowest(),
                           std::numeric_limits<double>::max()};
// From a forged command to the step at which it acts: the plant has to have it by then.
constexpr std::int64_t kLeadSteps = 20;
constexpr Interval kFiniteNonNegative{0.0, std::numeric_limits<double>::max()};

using Messages = std::vector<const DbcMessage*>;

// Numbers of a distribution, one per signal; a single number in the file stands for all of them.
std::vector<double> read_numbers(ConfigurationMap& map, const char* key, std::size_t count,
                                 double fallback, Interval allowed) {
  std::vector<double> numbers(count, fallback);
  map.read_shared(key, numbers, count, allowed);
  numbers.resize(count, fallback);
  return numbers;
}

void read_replay(ConfigurationMap& map, ReplayDelay& replay) {
  map.require("delay_steps");
  std::vector<double> range = {1.0, 1.0};
  map.read("delay_steps", range, 2, {1.0, static_cast<double>(ReplayDelay::kMax)});
  if (range.size() != 2) return;
  if (range[0] > range[1] || range[0] != std::floor(range[0]) || range[1] != std::floor(range[1])) {
    map.problem("delay_steps", "must be [low, high], whole numbers of steps");
  }
  replay.low = static_cast<int>(range[0]);
  replay.high = static_cast<int>(range[1]);
}

// A replay takes all signals of one frame as they were: it has no number to share or to add.
void check_replay(ConfigurationMap& map, const AttackRule& rule) {
  using Action = AttackRule::Action;
  if (rule.action == Action::kAdd || rule.action == Action::kScale) {
    map.problem("distribution",
                std::string("a replay writes earlier values and cannot be used by ") +
                    to_string(rule.action) + "; use substitute");
  }
  if (rule.value_draw != AttackRule::ValueDraw::kSignal) {
    map.problem("draw", "a replay draws one delay for each frame already; leave draw out");
  }
}

// What each signal makes of the number of the step; all share it, so that there is nothing to draw.
void read_gains(ConfigurationMap& map, AttackRule& rule) {
  const std::vector<double> gains = read_numbers(map, "gain", rule.values.size(), 1.0, kFinite);
  for (std::size_t i = 0; i < rule.values.size(); ++i) {
    rule.values[i].value = gains[i];
    if (rule.values[i].std != rule.values[0].std)
      map.problem("std", "one walk has one std; use gain");
  }
  if (rule.value_draw != AttackRule::ValueDraw::kSignal) {
    map.problem("draw", "signals share one number for each step already; leave draw out");
  }
}

void read_values(ConfigurationMap& rule_map, const std::string& folder, AttackRule& rule) {
  using Kind = ValueDistribution::Kind;
  const bool is_default = rule.action == AttackRule::Action::kForce && !rule_map.has("value");
  if (!is_default) rule_map.require("value");
  ConfigurationMap map = rule_map.map("value");
  Kind kind = Kind::kConstant;
  map.read_choice("distribution", kind,
                  {{"constant", Kind::kConstant},
                   {"uniform", Kind::kUniform},
                   {"normal", Kind::kNormal},
                   {"bernoulli", Kind::kBernoulli},
                   {"replay", Kind::kReplay},
                   {"waveform", Kind::kWaveform},
                   {"random_walk", Kind::kRandomWalk}});
  map.read_choice("draw", rule.value_draw,
                  {{"signal", AttackRule::ValueDraw::kSignal},
                   {"frame", AttackRule::ValueDraw::kFrame},
                   {"step", AttackRule::ValueDraw::kStep}});
  const std::size_t count = rule.signals.size();
  rule.values.assign(count, {kind});
  if ((!is_default && !rule_map.has("value")) || count == 0) return;
  const auto fill = [&](const char* key, double ValueDistribution::*field, Interval allowed) {
    if (!is_default) map.require(key);
    const std::vector<double> numbers =
        read_numbers(map, key, count, ValueDistribution().*field, allowed);
    for (std::size_t i = 0; i < count; ++i) rule.values[i].*field = numbers[i];
  };
  switch (kind) {
    case Kind::kConstant:
      fill("value", &ValueDistribution::value, kAnyNumber);
      break;
    case Kind::kUniform:
      fill("low", &ValueDistribution::low, kFinite);
      fill("high", &ValueDistribution::high, kFinite);
      for (const ValueDistribution& value : rule.values) {
        if (value.low > value.high) return map.problem("high", "lies below low");
      }
      break;
    case Kind::kNormal:
      fill("mean", &ValueDistribution::mean, kFinite);
      fill("std", &ValueDistribution::std, kFiniteNonNegative);
      break;
    case Kind::kBernoulli:
      fill("probability", &ValueDistribution::probability, kProbability);
      break;
    case Kind::kReplay:
      check_replay(map, rule);
      read_replay(map, rule.replay);
      break;
    case Kind::kWaveform:
      rule.waveform.read(map, folder);
      read_gains(map, rule);
      break;
    case Kind::kRandomWalk:
      fill("std", &ValueDistribution::std, kFiniteNonNegative);
      read_gains(map, rule);
      break;
  }
}

void read_count(ConfigurationMap map, CountDistribution& count) {
  using Kind = CountDistribution::Kind;
  map.read_choice("distribution", count.kind,
                  {{"constant", Kind::kConstant}, {"poisson", Kind::kPoisson}});
  map.read("mean", count.mean, {0.0, CountDistribution::kMax});
  if (count.kind == Kind::kConstant && count.mean != std::floor(count.mean)) {
    map.problem("mean", "a constant count must be a whole number");
  }
}

void read_flip(ConfigurationMap& map, AttackRule& rule, const Messages& selected) {
  const bool has_signal = map.has("signal");
  if (has_signal == map.has("bit")) {
    map.problem("action", "flip needs either signal or bit");
  }
  if (has_signal) {
    rule.signals.resize(1);
    map.read("signal", rule.signals[0]);
    check_signal(map, "signal", rule.signals[0], rule.match, selected);
  }
  if (!map.has("bit")) return;
  map.read("bit", rule.bit, {0.0, 8.0 * CanFrame::kBytesMax - 1.0});
  if (rule.match.messages.empty()) return;
  for (const DbcMessage* message : selected) {
    if (rule.bit >= 8 * message->num_bytes) {
      map.problem("bit", "message '" + message->name + "' has " +
                             std::to_string(8 * message->num_bytes) + " bits only");
    }
  }
}

// A command's mode by its name, in place of signal and value.
void read_mode(ConfigurationMap& map, const CommandLayout& command, AttackRule& rule) {
  std::string mode;
  map.read("mode", mode);
  const int index = command.find(mode);
  if (index < 0) {
    map.problem("mode",
                "'" + mode + "' is none of the plant's modes: " + name_list(command.mode_names));
  }
  for (const char* key : {"signal", "signals", "value"}) {
    if (!map.has(key)) continue;
    map.problem(key, "is the command's mode already: give mode or " + std::string(key));
    map.raw(key);
  }
  rule.signals = {command.mode_signal};
  rule.values.assign(1, {});
  rule.values.front().value = index;
}

void read_signals_and_values(ConfigurationMap& map, const std::string& folder, AttackRule& rule,
                             const FrameLayout& layout, const Messages& selected) {
  const bool writes =
      rule.action != AttackRule::Action::kAdd && rule.action != AttackRule::Action::kScale;
  if (rule.is_on_way_back && writes && map.has("mode")) return read_mode(map, layout.command, rule);
  if (map.has("signals")) {
    map.read("signals", rule.signals);
    if (map.has("signal")) {
      std::string unused;
      map.read("signal", unused);
      map.problem("signal", "is one of signals: give either");
    }
    if (rule.signals.empty()) map.problem("signals", "must name a signal");
    if (rule.signals.size() > AttackRule::kSignalsMax) {
      map.problem("signals", "at most " + std::to_string(AttackRule::kSignalsMax));
    }
    if (std::set<std::string>(rule.signals.begin(), rule.signals.end()).size() !=
        rule.signals.size()) {
      map.problem("signals", "must name each signal once");
    }
  } else {
    rule.signals.resize(1);
    map.require("signal");
    map.read("signal", rule.signals[0]);
  }
  const char* key = map.has("signals") ? "signals" : "signal";
  if (map.has(key)) {
    for (const std::string& signal : rule.signals)
      check_signal(map, key, signal, rule.match, selected);
  }
  read_values(map, folder, rule);
}

void read_inject(ConfigurationMap& map, const std::string& folder, AttackRule& rule,
                 const FrameLayout& layout, const Messages& selected) {
  read_signals_and_values(map, folder, rule, layout, selected);
  read_count(map.map("count"), rule.count);
  if (rule.is_on_way_back) {
    rule.counter_signal = layout.command.step_signal;
    rule.counter_offset = kLeadSteps;
    map.read("lead_steps", rule.counter_offset, {-1e9, 1e9});
    return;
  }
  rule.counter_signal = layout.counter_signal;
  const bool is_own_counter = map.has("counter_signal");
  map.read("counter_signal", rule.counter_signal);
  if (is_own_counter && !rule.counter_signal.empty()) {
    check_signal(map, "counter_signal", rule.counter_signal, rule.match, selected);
  }
  map.read("counter_offset", rule.counter_offset, {-9.0e15, 9.0e15});
  if (selected.empty())
    map.problem("match", "an injection needs a message of the DBC file to forge");
}

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
    if (named.action == AttackRule::Action::kDrop && rule.action != AttackRule::Action::kInject) {
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
}

AttackRule read_rule(ConfigurationMap map, const FrameLayout& layout, const std::string& folder,
                     const std::vector<AttackRule>& earlier) {
  using Action = AttackRule::Action;
  AttackRule rule;
  map.require("name");
  map.read("name", rule.name);
  map.require("action");
  map.read_choice("action", rule.action,
                  {{"drop", Action::kDrop},
                   {"flip", Action::kFlip},
                   {"substitute", Action::kSubstitute},
                   {"force", Action::kForce},
                   {"add", Action::kAdd},
                   {"scale", Action::kScale},
                   {"arm", Action::kArm},
                   {"inject", Action::kInject}});
  ConfigurationMap match_map = map.map("match");
  const Messages selected = read_match(match_map, rule.match, layout);
  if (rule.action == Action::kInject && !rule.match.signal.empty()) {
    match_map.problem("signal", "an injection compares nothing: there is no frame yet");
  }
  read_direction(match_map, layout, rule);
  rule.window.read(map.map("window"));
  if (map.has("times")) map.read("times", rule.times, {1.0, 1e15});
  map.read("probability", rule.probability, kProbability);
  map.read_choice("draw", rule.draw,
                  {{"frame", AttackRule::Draw::kFrame}, {"step", AttackRule::Draw::kStep}});
  read_conditions(map, rule, earlier);
  switch (rule.action) {
    case Action::kDrop:
    case Action::kArm:
      break;
    case Action::kFlip:
      read_flip(map, rule, selected);
      break;
    case Action::kSubstitute:
    case Action::kForce:
    case Action::kAdd:
    case Action::kScale:
      read_signals_and_values(map, folder, rule, layout, selected);
      break;
    case Action::kInject:
      read_inject(map, folder, rule, layout, selected);
      break;
  }
  check_way_back(map, rule);
  return rule;
}

}  // namespace

const char* to_string(AttackRule::Action action) {
  switch (action) {
    case AttackRule::Action::kDrop:
      return "drop";
    case AttackRule::Action::kFlip:
      return "flip";
    case AttackRule::Action::kSubstitute:
      return "substitute";
    case AttackRule::Action::kInject:
      return "inject";
    case AttackRule::Action::kForce:
      return "force";
    case AttackRule::Action::kAdd:
      return "add";
    case AttackRule::Action::kScale:
      return "scale";
    case AttackRule::Action::kArm:
      return "arm";
  }
  return "unknown";
}

std::vector<AttackRule> read_attack_rules(ConfigurationMap parent, const FrameLayout& layout,
                                          const std::string& folder) {
  std::vector<AttackRule> rules;
  std::set<std::string> names;
  for (ConfigurationMap map : parent.maps("attacks")) {
    rules.push_back(read_rule(map, layout, folder, rules));
    const std::string& name = rules.back().name;
    if (map.has("name") && name.empty()) map.problem("name", "must not be empty");
    if (!name.empty() && !names.insert(name).second)
      map.problem("name", "'" + name + "' given twice");
  }
  return rules;
}

}  // namespace holdfast
