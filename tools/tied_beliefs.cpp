#include "tools/tied_beliefs.h"

#include <algorithm>

namespace holdfast {
namespace {

bool is_always_open(const StepWindow& window) {
  const StepWindow everywhere;
  return window.first_step == everywhere.first_step && window.last_step == everywhere.last_step &&
         window.from_s == everywhere.from_s && window.to_s == everywhere.to_s;
}

// True for a rule that acts on each frame of its messages with one probability, in every step.
bool acts_always(const AttackRule& rule) {
  return rule.bit < 0 && rule.match.signal.empty() && rule.match.payload.value.empty() &&
         rule.match.type == AttackMatch::Type::kAny && !is_conditional(rule) &&
         is_always_open(rule.window);
}

bool is_same(const ConfigurationMap& map, const char* key) {
  std::string text = "same";
  return !map.has(key) || (map.scalar_text(key, text) && text == "same");
}

// A believed value that is tied to the true one by the word "same", so that a sweep moves both.
void read_assumed(ConfigurationMap& map, const char* key, std::vector<double>& value,
                  const std::vector<double>& truth) {
  if (is_same(map, key)) {
    std::string text = "same";
    map.read(key, text);
    value = truth;
  } else {
    map.read_shared(key, value, truth.size(), kProbability);
  }
}

// True for a rule that does what an estimator's belief about this action speaks of: to force a
// value is to substitute it.
bool does(const AttackRule& rule, AttackRule::Action action) {
  using Action = AttackRule::Action;
  return rule.action == action || (action == Action::kSubstitute && rule.action == Action::kForce);
}

// Probability that a sensor's bit arrives inverted. A rule that flips only at times has none.
std::vector<double> true_flip_probability(const MethodContext& context, std::size_t num_sensors,
                                          std::string& untied_rule) {
  std::vector<double> flip(num_sensors, 0.0);
  for (const AttackRule& rule : context.rules) {
    if (rule.action != AttackRule::Action::kFlip) continue;
    if (!acts_always(rule)) untied_rule = rule.name;
    for (std::size_t s = 0; s < flip.size() && s < context.layout.messages.size(); ++s) {
      const DbcMessage* message = context.layout.dbc.find(context.layout.messages[s]);
      if (message == nullptr || !selects(rule.match, *message)) continue;
      flip[s] = flip[s] * (1.0 - rule.probability) + (1.0 - flip[s]) * rule.probability;
    }
  }
  return flip;
}

void report_untied(ConfigurationMap& map, const char* key, const std::string& rule) {
  map.problem(
      key, "cannot be the same as rule '" + rule +
               "', which acts only at times, on some messages or under conditions; give a number");
}

}  // namespace

BinaryTargetModel::Attack read_assumed_attack(ConfigurationMap map,
                                              const BinaryTargetModel::Attack& truth,
                                              const MethodContext& context) {
  BinaryTargetModel::Attack assumes = truth;
  read_assumed(map, "dos", assumes.dos, truth.dos);
  read_assumed(map, "deception", assumes.deception, truth.deception);
  std::string untied_rule;
  const std::vector<double> flip = true_flip_probability(context, truth.dos.size(), untied_rule);
  if (is_same(map, "flip") && !untied_rule.empty()) report_untied(map, "flip", untied_rule);
  read_assumed(map, "flip", assumes.flip, flip);
  std::vector<double> range = {assumes.deception_low, assumes.deception_high};
  map.read("deception_range", range, 2);
  if (range.size() == 2 && range[0] < range[1]) {
    assumes.deception_low = range[0];
    assumes.deception_high = range[1];
  } else {
    map.problem("deception_range", "must be [low, high] with low < high");
  }
  return assumes;
}

std::optional<double> tied_probability(ConfigurationMap& map, const char* key,
                                       AttackRule::Action action, bool is_touched,
                                       const MethodContext& context) {
  std::string text;
  if (!map.scalar_text(key, text) || text != "same") return std::nullopt;
  double untouched = 1.0;
  std::string untied_rule;
  for (const AttackRule& rule : context.rules) {
    if (!does(rule, action) || rule.probability == 0.0) continue;
    const bool takes_all =
        std::ranges::all_of(context.layout.messages, [&](const std::string& name) {
          const DbcMessage* message = context.layout.dbc.find(name);
          // One that is not there is told elsewhere.
          return message == nullptr || selects(rule.match, *message);
        });
    if (acts_always(rule) && takes_all) {
      untouched *= 1.0 - rule.probability;
    } else {
      untied_rule = rule.name;
    }
  }
  if (!untied_rule.empty()) report_untied(map, key, untied_rule);
  return is_touched ? 1.0 - untouched : untouched;
}

std::optional<double> probability_of_rule(ConfigurationMap& map, const char* key,
                                          AttackRule::Action action, const MethodContext& context) {
  if (!is_same(map, key)) return std::nullopt;
  const AttackRule* found = nullptr;
  for (const AttackRule& rule : context.rules) {
    if (rule.action != action) continue;
    if (found != nullptr) {
      map.problem(key, "cannot be the same: several rules have the action '" +
                           std::string(to_string(action)) + "'; give a number");
      return std::nullopt;
    }
    found = &rule;
  }
  if (found != nullptr &&
      (found->chain || found->every != 1 || found->times != AttackRule().times)) {
    map.problem(key, "cannot be the same as rule '" + found->name +
                         "', which does not act with one probability; give a number");
    return std::nullopt;
  }
  // Where nothing acts, nothing is believed: a sweep may leave a rule out.
  return found == nullptr ? 0.0 : found->probability;
}

}  // namespace holdfast
