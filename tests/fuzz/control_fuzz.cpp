// libFuzzer target: requests to a running attacker, one a line, with frames between them. Each is
// answered by one line of JSON; a refused one changes nothing; what is listed can be put back.

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/fuzz/support.h"
#include "tools/rule_book.h"

namespace holdfast {

// The rest of tools/experiment.cpp reads plants and estimators, which no request reaches.
std::string stealth_fault(const AttackRule& rule, const Experiment& /*experiment*/) {
  return is_stealthy(rule) ? "stealth needs a plant" : "";
}

namespace {

using fuzzing::must;
using Json = nlohmann::ordered_json;

constexpr std::size_t kRequestsMax = 6;

Json ask(RuleBook& book, const std::string& request) {
  double watch_s = 0.0;
  const std::string answer = book.answer(request, watch_s);
  must(answer.find('\n') == std::string::npos && watch_s >= 0.0 && watch_s <= 3600.0);
  const Json json = Json::parse(answer);
  must(json["ok"].get<bool>() != json.contains("error"));
  return json;
}

// What frames count goes on between two lists.
Json texts_of(const Json& list) {
  Json texts = Json::array();
  texts.push_back(list["generation"]);
  for (const Json& rule : list["rules"])
    texts.push_back(Json::array({rule["text"], rule["paused"]}));
  return texts;
}

// The text of a rule as it is listed stands for the rule.
void put_back(RuleBook& book, const Json& list) {
  if (list["rules"].empty()) return;
  const Json text = list["rules"].back()["text"];
  must(ask(book, Json{{"do", "change"}, {"rule", text}}.dump())["ok"].get<bool>());
  must(ask(book, R"({"do":"list"})")["rules"].back()["text"] == text);
}

}  // namespace
}  // namespace holdfast

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace holdfast;
  static const Experiment experiment = [] {
    Experiment it;
    it.layout = fuzzing::layout_of("plain");
    it.resolved =
        "attacks: [{name: half, match: {messages: [Plain]}, action: drop, probability: 0.5}]";
    return it;
  }();
  static const auto steps = fuzzing::frames_of_steps(experiment.layout, kRequestsMax);
  ConfigurationDocument document = ConfigurationDocument::from_text(experiment.resolved, "rules");
  ProxyCore core(read_attack_rules(document.root(), experiment.layout), experiment.layout, 1, 0, 1);
  RuleBook book(experiment, core);
  ProxyOutput out;
  std::string_view text = fuzzing::text_of(data, size);
  Json list = ask(book, R"({"do":"list"})");
  for (std::size_t i = 0; i < kRequestsMax && !text.empty(); ++i) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const bool is_good = ask(book, std::string(text.substr(0, end)))["ok"].get<bool>();
    text.remove_prefix(std::min(end + 1, text.size()));
    const Json after = ask(book, R"({"do":"list"})");
    must(after["ok"].get<bool>() && (is_good || texts_of(after) == texts_of(list)));
    for (const CanFrame& frame : steps[i]) core.on_frame(frame, out);
    must(core.counters().balance());
    list = after;
  }
  put_back(book, list);
  must(core.counters().sent == static_cast<std::int64_t>(out.frames.size()));
  return 0;
}
