// Requests that change the rules of a running attacker.
#include "tools/rule_book.h"

#include <nlohmann/json.hpp>

#include "tests/support/catch.h"
#include "tests/unit/tools/experiment/scenario_texts.h"

namespace holdfast {
namespace {

using Json = nlohmann::json;

struct Controlled {
  Experiment experiment = load_experiment(testing::scenario("binary_tracking"));
  ProxyCore core = experiment.make_proxy(0, true);
  RuleBook book{experiment, core};
  double watch_s = 0.0;

  Json ask(const std::string& request) { return Json::parse(book.answer(request, watch_s)); }
  std::string error_of(const std::string& request) {
    const std::int64_t before = core.generation();
    const Json answer = ask(request);
    CHECK(answer.at("ok") == false);
    CHECK(core.generation() == before);
    UNSCOPED_INFO(answer);
    return answer.value("error", "");
  }
};

const std::string kDropRule =
    R"({"name": "lost", "match": {"messages": ["Sensor01"]}, "action": "drop", "probability": 0.5})";

}  // namespace

TEST_CASE("rules are listed, added, changed, paused and removed, each time a generation further") {
  Controlled c;
  const Json first = c.ask(R"({"do": "list"})");
  CHECK(first.at("generation") == 0);
  CHECK(first.at("rules").size() == 1);
  const std::string scenario_rule = first["rules"][0]["name"];
  CHECK(c.ask(R"({"do": "add", "rule": )" + kDropRule + "}").at("generation") == 1);
  REQUIRE(c.core.rules().size() == 2);
  CHECK(c.core.rules()[1].probability == 0.5);
  // As YAML text, too.
  CHECK(c.ask(R"({"do": "change", "rule": "{name: lost, action: drop, probability: 0.25}"})")
            .at("ok") == true);
  CHECK(c.core.rules()[1].probability == 0.25);
  CHECK(c.ask(R"({"do": "pause", "name": "lost"})").at("ok") == true);
  CHECK(c.core.rules()[1].is_paused);
  CHECK_FALSE(c.core.rules()[0].is_paused);
  CHECK(c.ask(R"({"do": "pause"})").at("generation") == 4);
  CHECK(c.core.rules()[0].is_paused);
  CHECK(c.ask(R"({"do": "resume"})").at("ok") == true);
  CHECK_FALSE(c.core.rules()[1].is_paused);
  CHECK(c.ask(R"({"do": "remove", "name": ")" + scenario_rule + "\"}").at("ok") == true);
  const Json last = c.ask(R"({"do": "list"})");
  REQUIRE(last.at("rules").size() == 1);
  CHECK(last["rules"][0]["name"] == "lost");
  CHECK(last["rules"][0]["action"] == "drop");
  CHECK(c.ask(R"({"do": "swap", "rules": []})").at("ok") == true);
  CHECK(c.core.rules().empty());
  CHECK(
      c.ask(
           R"({"do": "swap", "rules": "[{name: a, action: arm}, {name: b, given: a, action: drop}]"})")
          .at("ok") == true);
  CHECK(c.core.rules().size() == 2);
}

TEST_CASE("what is wrong changes nothing and says why") {
  Controlled c;
  CHECK(c.error_of("nonsense") != "");
  CHECK(c.error_of("[]").find("\"do\"") != std::string::npos);
  CHECK(c.error_of(R"({"do": 3})").find("\"do\"") != std::string::npos);
  CHECK(c.error_of(R"({"do": "destroy"})").find("none of: list") != std::string::npos);
  CHECK(c.error_of(R"({"do": "add"})").find("needs \"rule\"") != std::string::npos);
  CHECK(c.error_of(R"({"do": "add", "rule": "{name: x, action: drp}"})").find("drop, flip") !=
        std::string::npos);
  CHECK(c.error_of(R"({"do": "add", "rule": "{name: x, action: drop, typo: 1}"})").find("typo") !=
        std::string::npos);
  CHECK(c.error_of(R"({"do": "add", "rule": [1, 2]})").find("map with a name") !=
        std::string::npos);
  CHECK(c.error_of(R"({"do": "add", "rule": "{: : ["})") != "");
  CHECK(c.error_of(R"({"do": "remove", "name": "nobody"})").find("no rule is named 'nobody'") !=
        std::string::npos);
  CHECK(c.error_of(R"({"do": "remove", "name": 7})").find("must be text") != std::string::npos);
  CHECK(c.error_of(R"({"do": "add", "rule": )" + std::string(100000, '[') +
                   std::string(100000, ']') + "}")
            .find("so deeply") != std::string::npos);
  CHECK(c.error_of(R"({"do": "swap", "rules": {"name": "a"}})").find("list") != std::string::npos);
  CHECK(c.error_of(R"({"do": "watch", "timeout_s": 0.001})").find("timeout_s") !=
        std::string::npos);
  // A rule that another one is given cannot go alone.
  REQUIRE(
      c.ask(
           R"({"do": "swap", "rules": "[{name: a, action: arm}, {name: b, given: a, action: drop}]"})")
          .at("ok") == true);
  CHECK(c.error_of(R"({"do": "remove", "name": "a"})").find("no earlier rule is named 'a'") !=
        std::string::npos);
  CHECK(
      c.error_of(
           R"({"do": "add", "rule": "{name: s, match: {messages: [Sensor01]}, action: add, signal: DETECT, value: {value: 1}, stealth: {residual_most: 1}}"})")
          .find("vector readings") != std::string::npos);
  CHECK(c.core.rules().size() == 2);
}

TEST_CASE("when nobody controls them any more, all rules pause, until somebody resumes them") {
  Controlled c;
  CHECK(c.ask(R"({"do": "watch", "timeout_s": 2})").at("ok") == true);
  CHECK(c.watch_s == 2.0);
  CHECK(c.ask(R"({"do": "ping"})").at("generation") == 0);
  CHECK(c.book.pause_all());
  CHECK(c.core.rules()[0].is_paused);
  CHECK_FALSE(c.book.pause_all());
  // Neither does a swap wake one that it keeps.
  const std::string name = c.core.rules()[0].name;
  REQUIRE(c.ask(R"({"do": "swap", "rules": "[{name: )" + name +
                R"(, action: drop}, {name: b, action: drop}]"})")
              .at("ok") == true);
  CHECK(c.core.rules()[0].is_paused);
  CHECK_FALSE(c.core.rules()[1].is_paused);
  CHECK(c.ask(R"({"do": "resume"})").at("generation") == 3);
  CHECK_FALSE(c.core.rules()[0].is_paused);
}

}  // namespace holdfast
