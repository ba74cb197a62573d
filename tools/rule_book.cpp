#include "tools/rule_book.h"

#include <yaml-cpp/yaml.h>
#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "common/errors.h"

namespace holdfast {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kDepthMax = 16;

// As JSON, which is YAML, or as the text of YAML.
std::string yaml_of(const Json& value) {
  return value.is_string() ? value.get<std::string>() : value.dump();
}

std::string text_of(const YAML::Node& node) {
  YAML::Emitter emitter;
  emitter << node;
  return emitter.c_str();
}

}  // namespace

RuleBook::RuleBook(const Experiment& experiment, ProxyCore& core)
    : experiment_(experiment), core_(core) {
  const YAML::Node rules = YAML::Load(experiment.resolved)["attacks"];
  if (rules && rules.IsSequence()) entries_ = list_of(text_of(rules));
}

RuleBook::Entry RuleBook::entry_of(const std::string& text) {
  const YAML::Node rule = YAML::Load(text);
  if (!rule.IsMap() || !rule["name"] || !rule["name"].IsScalar())
    throw UsageError("a rule is a map with a name");
  return {rule["name"].as<std::string>(), text, false};
}

RuleBook::Entries RuleBook::list_of(const std::string& text) {
  const YAML::Node rules = YAML::Load(text);
  if (!rules.IsSequence()) throw UsageError("a list of rules is needed");
  Entries entries;
  for (const YAML::Node& rule : rules) entries.push_back(entry_of(text_of(rule)));
  return entries;
}

std::size_t RuleBook::find(const Entries& entries, const std::string& name) const {
  const auto found = std::ranges::find(entries, name, &Entry::name);
  if (found != entries.end()) return static_cast<std::size_t>(found - entries.begin());
  std::string names;
  for (const Entry& entry : entries) names += (names.empty() ? "" : ", ") + entry.name;
  throw UsageError("no rule is named '" + name + "'; rules: " + (names.empty() ? "none" : names));
}

// Throws before anything has changed.
void RuleBook::adopt(Entries entries) {
  YAML::Node document;
  document["attacks"] = YAML::Node(YAML::NodeType::Sequence);
  for (const Entry& entry : entries) document["attacks"].push_back(YAML::Load(entry.text));
  ConfigurationDocument text = ConfigurationDocument::from_text(text_of(document), "rules");
  std::vector<AttackRule> rules = read_attack_rules(text.root(), experiment_.layout);
  text.finish();
  for (const AttackRule& rule : rules) {
    const std::string fault = stealth_fault(rule, experiment_);
    if (!fault.empty()) throw UsageError("rule '" + rule.name + "': " + fault);
  }
  for (std::size_t i = 0; i < rules.size(); ++i) rules[i].is_paused = entries[i].is_paused;
  core_.replace_rules(std::move(rules), experiment_.layout);
  entries_ = std::move(entries);
}

RuleBook::Entries RuleBook::changed(const std::string& what, const std::string& name,
                                    const std::string& text) const {
  if (what == "swap") {
    Entries swapped = list_of(text);
    for (Entry& entry : swapped) {
      const auto old = std::ranges::find(entries_, entry.name, &Entry::name);
      entry.is_paused = old != entries_.end() && old->is_paused;
    }
    return swapped;
  }
  Entries entries = entries_;
  if (what == "add") {
    entries.push_back(entry_of(text));
  } else if (what == "change") {
    const Entry entry = entry_of(text);
    entries[find(entries, entry.name)].text = text;
  } else if (what == "remove") {
    entries.erase(entries.begin() + static_cast<std::ptrdiff_t>(find(entries, name)));
  } else if (name.empty()) {
    for (Entry& entry : entries) entry.is_paused = what == "pause";
  } else {
    entries[find(entries, name)].is_paused = what == "pause";
  }
  return entries;
}

std::string RuleBook::state_text(bool with_rules) const {
  Json json = {{"ok", true}, {"generation", core_.generation()}, {"step", core_.current_step()}};
  if (!with_rules) return json.dump();
  json["rules"] = Json::array();
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    const AttackRule& rule = core_.rules()[i];
    json["rules"].push_back({{"name", rule.name},
                             {"action", to_string(rule.action)},
                             {"paused", rule.is_paused},
                             {"acted", core_.num_acts(i)},
                             {"text", entries_[i].text}});
  }
  return json.dump();
}

std::string RuleBook::answer(const std::string& request, double& watch_s) {
  try {
    const Json json = Json::parse(request, [](int depth, Json::parse_event_t, Json&) {
      if (depth > kDepthMax) throw UsageError("a request is not nested so deeply");
      return true;
    });
    if (!json.is_object() || !json.contains("do") || !json["do"].is_string())
      throw UsageError("a request is a JSON object with \"do\"");
    const std::string what = json["do"].get<std::string>();
    const auto needs = [&](const char* key) {
      if (!json.contains(key)) throw UsageError(what + " needs \"" + key + '"');
      return json[key];
    };
    const auto text_at = [&](const char* key) {
      const Json value = needs(key);
      if (!value.is_string()) throw UsageError(std::string(key) + " must be text");
      return value.get<std::string>();
    };
    if (what == "list" || what == "ping") return state_text(what == "list");
    if (what == "watch") {
      const Json value = needs("timeout_s");
      const double seconds = value.is_number() ? value.get<double>() : -1.0;
      if (seconds != 0.0 && !(seconds >= 0.05 && seconds <= 3600.0))
        throw UsageError("timeout_s must be 0.05 to 3600, or 0 to be watched no more");
      watch_s = seconds;
      return state_text(false);
    }
    std::string name;
    std::string text;
    if (what == "add" || what == "change") {
      text = yaml_of(needs("rule"));
    } else if (what == "swap") {
      text = yaml_of(needs("rules"));
    } else if (what == "remove") {
      name = text_at("name");
    } else if (what == "pause" || what == "resume") {
      if (json.contains("name")) name = text_at("name");
    } else {
      throw UsageError("'" + what +
                       "' is none of: list, add, change, remove, pause, resume, swap, watch, ping");
    }
    adopt(changed(what, name, text));
    return state_text(false);
  } catch (const std::exception& error) {
    return Json{{"ok", false}, {"error", error.what()}}.dump(-1, ' ', false,
                                                             Json::error_handler_t::replace);
  }
}

bool RuleBook::pause_all() {
  if (std::ranges::all_of(entries_, [](const Entry& entry) { return entry.is_paused; }))
    return false;
  adopt(changed("pause", "", ""));
  return true;
}

}  // namespace holdfast
