#include "attacker/attack_action.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <set>

#include "common/name_list.h"
#include "drivers/can/hex_bytes.h"

namespace holdfast {
namespace {

constexpr Interval kFinite{std::numeric_limits<double>::lowest(),
                           std::numeric_limits<double>::max()};
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

// One number of steps, or [low, high].
void read_delay(ConfigurationMap& map, StepDelay& delay) {
  map.require("delay_steps");
  const Interval allowed{1.0, static_cast<double>(StepDelay::kMax)};
  std::vector<double> range = {1.0, 1.0};
  if (std::string one; map.scalar_text("delay_steps", one)) {
    map.read("delay_steps", range[0], allowed);
    range[1] = range[0];
  } else {
    map.read("delay_steps", range, 2, allowed);
  }
  if (range.size() != 2) return;
  if (range[0] > range[1]) {
    map.problem("delay_steps", "must be [low, high] with low at most high");
  } else if (range[0] != std::floor(range[0]) || range[1] != std::floor(range[1])) {
    map.problem("delay_steps", "must be a whole number of steps or [low, high]");
  }
  delay.low = static_cast<int>(range[0]);
  delay.high = static_cast<int>(range[1]);
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
      read_delay(map, rule.delay);
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

// Those that must be in a frame before the rule acts on it.
std::vector<std::string> needed_signals(const AttackRule& rule) {
  std::vector<std::string> names = rule.signals;
  if (!rule.match.signal.empty()) names.push_back(rule.match.signal);
  return names;
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
    check_together(map, "signal", needed_signals(rule), selected);
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

void read_signals(ConfigurationMap& map, AttackRule& rule, const Messages& selected) {
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
    check_together(map, key, needed_signals(rule), selected);
  }
}

// A command's mode by its name, in place of signal and value.
void read_mode(ConfigurationMap& map, const CommandLayout& command, AttackRule& rule) {
  const int index = read_name(map, "mode", "the plant's modes", command.mode_names);
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
  read_signals(map, rule, selected);
  read_values(map, folder, rule);
}

void read_counter(ConfigurationMap& map, AttackRule& rule, const FrameLayout& layout,
                  const Messages& selected) {
  rule.counter_signal = layout.counter_signal;
  const bool is_own_counter = map.has("counter_signal");
  map.read("counter_signal", rule.counter_signal);
  if (is_own_counter && !rule.counter_signal.empty()) {
    check_signal(map, "counter_signal", rule.counter_signal, rule.match, selected);
    // Of an injection check_forged() tells.
    std::vector<std::string> names = rule.signals;
    names.push_back(rule.counter_signal);
    if (suspends(rule)) check_together(map, "counter_signal", names, selected);
  }
  map.read("counter_offset", rule.counter_offset, {-9.0e15, 9.0e15});
}

// Of signals that can be in a frame together: that they still are with an injection's counter, and
// with the constants that are written into selectors among them.
void check_forged(ConfigurationMap& map, const AttackRule& rule, const Messages& selected) {
  const DbcMessage* without = nullptr;
  for (const DbcMessage* message : selected) {
    const std::optional<std::vector<DbcSignal>> found = find_signals(*message, rule.signals);
    if (!found || !message->frame_for(*found)) continue;
    if (frame_to_forge(rule, *message)) return;
    without = message;
  }
  if (without == nullptr) return;
  AttackRule uncounted = rule;
  uncounted.counter_signal.clear();
  const std::string no_frame = "no frame of message '" + without->name + "' carries ";
  if (!frame_to_forge(uncounted, *without)) {
    map.problem("value", no_frame + "all signals when its selectors have these values");
  } else {
    const bool is_own = map.has("counter_signal");
    map.problem(is_own               ? "counter_signal"
                : map.has("signals") ? "signals"
                                     : "signal",
                no_frame + "the counter '" + rule.counter_signal + "' with what the rule writes" +
                    (is_own ? "" : "; counter_signal: \"\" does without"));
  }
}

void read_inject(ConfigurationMap& map, const std::string& folder, AttackRule& rule,
                 const FrameLayout& layout, const Messages& selected) {
  read_signals_and_values(map, folder, rule, layout, selected);
  read_count(map.map("count"), rule.count);
  if (rule.is_on_way_back) {
    rule.counter_signal = layout.command.step_signal;
    rule.counter_offset = CommandLayout::kLeadSteps;
    map.read("lead_steps", rule.counter_offset, {-1e9, 1e9});
    if (std::find(rule.signals.begin(), rule.signals.end(), rule.counter_signal) !=
        rule.signals.end()) {
      map.problem(map.has("signals") ? "signals" : "signal",
                  "'" + rule.counter_signal + "' is what lead_steps says");
    }
    if (std::find(rule.signals.begin(), rule.signals.end(), layout.command.mode_signal) ==
        rule.signals.end()) {
      map.problem("action", "a forged command needs its mode: mode, or signal '" +
                                layout.command.mode_signal + "'");
    }
    return;
  }
  read_counter(map, rule, layout, selected);
  if (selected.empty())
    map.problem("match", "an injection needs a message of the DBC file to forge");
}

// The signals that a masquerade writes; without any its frames repeat the last genuine one.
void read_masquerade(ConfigurationMap& map, const std::string& folder, AttackRule& rule,
                     const FrameLayout& layout, const Messages& selected) {
  if (map.has("signal") || map.has("signals") || map.has("value")) {
    read_signals(map, rule, selected);
    read_values(map, folder, rule);
  }
  read_counter(map, rule, layout, selected);
  if (selected.empty())
    map.problem("match", "a masquerade needs a message of the DBC file to forge");
}

// What stands beside the value of an addition that is to stay unnoticed.
void read_stealth(ConfigurationMap& map, AttackRule& rule) {
  if (!map.has("stealth")) return;
  ConfigurationMap stealth = map.map("stealth");
  stealth.require("residual_most");
  stealth.read("residual_most", rule.residual_most, {0.0, 1e6});
  if (rule.is_on_way_back)
    map.problem("stealth", "commands are no readings: no filter has a residual for them");
}

void read_bits(ConfigurationMap& map, PayloadEdit& edit, const Messages& selected,
               const AttackMatch& match) {
  map.read("at", edit.at, {0.0, CanFrame::kBytesMax - 1.0});
  std::size_t size = 0;
  const auto read_bytes = [&](const char* key) {
    std::vector<std::uint8_t> bytes;
    if (!map.has(key)) return bytes;
    std::string text;
    map.read(key, text);
    const auto parsed = parse_hex_bytes(text);
    if (!parsed || static_cast<std::size_t>(edit.at) + parsed->size() > CanFrame::kBytesMax) {
      map.problem(key, "'" + text + "' must be bytes as pairs of hexadecimal digits, to byte 63");
      return bytes;
    }
    size = std::max(size, parsed->size());
    return *parsed;
  };
  const std::vector<std::uint8_t> written = read_bytes("set");
  edit.keep = read_bytes("and");
  edit.set = read_bytes("or");
  edit.flip = read_bytes("xor");
  if (!map.has("set") && !map.has("and") && !map.has("or") && !map.has("xor"))
    map.problem("action", "bits needs set, and, or, xor, or several of them");
  edit.keep.resize(size, 0xFF);
  edit.set.resize(size, 0);
  edit.flip.resize(size, 0);
  // Written first, so that the others work on what was written.
  for (std::size_t i = 0; i < written.size(); ++i) {
    edit.set[i] = static_cast<std::uint8_t>(edit.set[i] | (written[i] & edit.keep[i]));
    edit.keep[i] = 0;
  }
  if (match.messages.empty()) return;
  for (const DbcMessage* message : selected) {
    if (static_cast<std::size_t>(edit.at) + size <= message->num_bytes) continue;
    map.problem("at", "message '" + message->name + "' has " + std::to_string(message->num_bytes) +
                          " bytes only");
  }
}

}  // namespace

void read_action(ConfigurationMap& map, const std::string& folder, const FrameLayout& layout,
                 const Messages& selected, AttackRule& rule) {
  using Action = AttackRule::Action;
  switch (rule.action) {
    case Action::kDrop:
    case Action::kArm:
      break;
    case Action::kFlip:
      read_flip(map, rule, selected);
      break;
    case Action::kBits:
      read_bits(map, rule.edit, selected, rule.match);
      break;
    case Action::kFreeze:
      read_signals(map, rule, selected);
      break;
    case Action::kDuplicate:
      map.read("copies", rule.copies, {1.0, 100.0});
      break;
    case Action::kDelay:
      read_delay(map, rule.delay);
      map.read("reorder", rule.reorders);
      break;
    case Action::kSubstitute:
    case Action::kForce:
    case Action::kScale:
      read_signals_and_values(map, folder, rule, layout, selected);
      break;
    case Action::kAdd:
      read_signals_and_values(map, folder, rule, layout, selected);
      read_stealth(map, rule);
      break;
    case Action::kMasquerade:
      read_masquerade(map, folder, rule, layout, selected);
      break;
    case Action::kInject:
      read_inject(map, folder, rule, layout, selected);
      break;
  }
  if (forges(rule)) check_forged(map, rule, selected);
}

}  // namespace holdfast
