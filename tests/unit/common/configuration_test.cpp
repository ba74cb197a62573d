#include "common/configuration.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>

#include "common/configuration_text.h"
#include "tests/support/catch.h"
#include "tests/support/temporary_folder.h"

namespace holdfast {
namespace {

enum class Colour { kRed, kGreen };

// What a scenario looks like to its readers: one of everything.
struct Settings {
  double variance = 1.0;
  std::int64_t seed = 1;
  int num_steps = 100;
  bool is_on = true;
  std::string text = "plain";
  std::vector<std::string> names{"a", "b"};
  std::vector<double> attack_probability{0.1, 0.1, 0.1};
  std::vector<double> mean{0.0, 0.0};
  std::vector<std::vector<double>> matrix{{1.0, 0.0}, {0.0, 1.0}};
  Colour colour = Colour::kGreen;
  double inner_period_s = 0.5;
  double open_end_s = std::numeric_limits<double>::infinity();
  std::vector<std::pair<std::string, double>> items;
};

Settings read_settings(ConfigurationDocument& document) {
  Settings settings;
  ConfigurationMap root = document.root();
  root.read("variance", settings.variance, kNonNegative);
  root.read("seed", settings.seed);
  root.read("num_steps", settings.num_steps, Interval{1});
  root.read("is_on", settings.is_on);
  root.read("text", settings.text);
  root.read("names", settings.names);
  root.read_shared("attack_probability", settings.attack_probability, 3, kProbability);
  root.read("mean", settings.mean, 2);
  root.read("matrix", settings.matrix, 2);
  root.read_choice("colour", settings.colour, {{"red", Colour::kRed}, {"green", Colour::kGreen}});
  ConfigurationMap inner = root.map("inner");
  inner.read("period_s", settings.inner_period_s, kPositive);
  inner.read("open_end_s", settings.open_end_s);
  for (ConfigurationMap& item : root.maps("items")) {
    item.require("name");
    auto& [name, value] = settings.items.emplace_back();
    item.read("name", name);
    item.read("value", value);
  }
  document.finish();
  return settings;
}

Settings read_text(const std::string& text, const std::vector<std::string>& overrides = {}) {
  auto document = ConfigurationDocument::from_text(text, "file.yaml", overrides);
  return read_settings(document);
}

std::string problems(const std::string& text, const std::vector<std::string>& overrides = {}) {
  try {
    read_text(text, overrides);
  } catch (const ConfigurationError& error) {
    return error.what();
  }
  return "no problem";
}

std::string resolved(const std::string& text, const std::vector<std::string>& overrides = {}) {
  auto document = ConfigurationDocument::from_text(text, "file.yaml", overrides);
  read_settings(document);
  return document.resolved_text();
}

}  // namespace

TEST_CASE("each kind of problem is told with its place") {
  struct Example {
    const char* text;
    const char* problem;
  };
  const Example examples[] = {
      {"seed: 1\nspeed: 2\n", "file.yaml:2:1: speed: unknown key"},
      {"inner:\n  period: 1\n", "file.yaml:2:3: inner.period: unknown key"},
      {"items:\n  - name: a\n    valu: 1\n", "file.yaml:3:5: items[0].valu: unknown key"},
      {"seed: 1\nseed: 2\n", "file.yaml:2:1: seed: key given twice"},
      {"variance: fast\n", "file.yaml:1:11: variance: 'fast' is no number"},
      {"variance: [1]\n", "file.yaml:1:11: variance: a list is no number"},
      {"variance: .nan\n", "file.yaml:1:11: variance: '.nan' is no number"},
      {"variance: .inf\n", "file.yaml:1:11: variance: .inf must be finite"},
      {"variance: -0.5\n", "file.yaml:1:11: variance: -0.5 must be 0 or more"},
      {"seed: 1.5\n", "file.yaml:1:7: seed: '1.5' is no whole number"},
      {"seed: 9223372036854775808\n",
       "file.yaml:1:7: seed: '9223372036854775808' is no whole number"},
      {"seed: 010\n", "file.yaml:1:7: seed: '010' is no whole number"},
      {"num_steps: 0\n", "file.yaml:1:12: num_steps: 0 must be in [1, 2147483647]"},
      {"num_steps: 3000000000\n",
       "file.yaml:1:12: num_steps: 3000000000 must be in [1, 2147483647]"},
      {"is_on: maybe\n", "file.yaml:1:8: is_on: 'maybe' must be true or false"},
      {"text: {a: 1}\n", "file.yaml:1:7: text: a map must be text"},
      {"names: a\n", "file.yaml:1:8: names: 'a' must be a list"},
      {"names: [a, [b]]\n", "file.yaml:1:12: names: a list must be text"},
      {"attack_probability: 1.2\n", "file.yaml:1:21: attack_probability: 1.2 must be in [0, 1]"},
      {"attack_probability: [0, 0.5, -0.1]\n",
       "file.yaml:1:30: attack_probability: -0.1 must be in [0, 1]"},
      {"attack_probability: [0, 0.5]\n",
       "file.yaml:1:21: attack_probability: 2 numbers, must be 3"},
      {"mean: 3\n", "file.yaml:1:7: mean: '3' must be a list of numbers"},
      {"matrix: [[1, 0], [1]]\n", "file.yaml:1:18: matrix[1]: must be a row of 2 numbers"},
      {"matrix: [[1, 0], [1, x]]\n", "file.yaml:1:22: matrix: 'x' is no number"},
      {"matrix: 1\n", "file.yaml:1:9: matrix: '1' must be a list of rows"},
      {"colour: blue\n", "file.yaml:1:9: colour: 'blue' is none of: red, green"},
      {"inner: 3\n", "file.yaml:1:8: inner: '3' must be a map"},
      {"inner: {period_s: 0}\n", "file.yaml:1:19: inner.period_s: 0 must be above 0"},
      {"items: {a: 1}\n", "file.yaml:1:8: items: a map must be a list"},
      {"items: [3]\n", "file.yaml:1:9: items[0]: '3' must be a map"},
      {"items:\n  - value: 1\n", "file.yaml:2:5: items[0].name: missing"},
  };
  for (const Example& example : examples) {
    INFO(example.text);
    const std::string told = problems(example.text);
    INFO(told);
    CHECK(told.substr(0, told.find('\n')) == example.problem);
  }
}

TEST_CASE("all problems of a file are told at once, in the order of the file") {
  const std::string told =
      problems("speed: 1\nvariance: -1\ncolour: blue\ninner:\n  period: 2\n  period_s: x\n");
  CHECK(told ==
        "file.yaml:1:1: speed: unknown key\n"
        "file.yaml:2:11: variance: -1 must be 0 or more\n"
        "file.yaml:3:9: colour: 'blue' is none of: red, green\n"
        "file.yaml:5:3: inner.period: unknown key\n"
        "file.yaml:6:13: inner.period_s: 'x' is no number");
}

TEST_CASE("a file that is no configuration is refused with its place") {
  CHECK(problems("a: [1, 2\nb: 3\n").find("file.yaml:2:") == 0);
  CHECK(problems("").find("file.yaml:1:1: must be one YAML map") == 0);
  CHECK(problems("- 1\n- 2\n").find("file.yaml:1:1: must be one YAML map") == 0);
  CHECK(problems("seed: 1\n---\nseed: 2\n").find("file.yaml:1:1: must be one YAML map") == 0);
  // yaml-cpp's LoadAll reads these for ever.
  CHECK(problems(", seed: 1\n").find("file.yaml:1:1: must be one YAML map") == 0);
  CHECK(problems("{seed: 1}, seed\n").find("file.yaml:1:1: must be one YAML map") == 0);
  CHECK_THROWS_AS(ConfigurationDocument::from_file("/no/such/file.yaml"), ConfigurationError);
  const testing::TemporaryFolder folder;
  CHECK_THROWS_AS(ConfigurationDocument::from_file(folder.file("")), ConfigurationError);
}

TEST_CASE("aliases that make a document endless, or too large, are refused") {
  // Each of these once ran out of stack, or of patience, in a reader that followed them.
  std::string doubling = "a0: &a0 [x, y]\n";
  for (int i = 1; i < 40; ++i) {
    const std::string before = std::to_string(i - 1), own = std::to_string(i);
    doubling += "a" + own + ": &a" + own + " [*a" + before + ", *a" + before + "]\n";
  }
  const std::pair<std::string, const char*> refused[] = {
      {"names: &a [*a]", "within itself"},
      {"inner: &a {period_s: 1, items: [*a]}", "within itself"},
      {doubling, "aliases"},
      {"names: " + std::string(150, '[') + std::string(150, ']'), "more than 100 deep"}};
  for (const auto& [text, part] : refused) {
    INFO(text.substr(0, 60));
    CHECK_THROWS_WITH(ConfigurationDocument::from_text(text, "s.yaml"),
                      Catch::StartsWith("s.yaml: ") && Catch::Contains(part));
  }
  CHECK_THROWS_WITH(
      ConfigurationDocument::from_text("names: [a]", "s.yaml", {"names=&a [*a]", "names=[b]"}),
      Catch::StartsWith("--set names=&a [*a]: "));
  // What a scenario does with them still stands.
  ConfigurationDocument document =
      ConfigurationDocument::from_text("names: &n [c, d]\ntext: &t word\n", "s.yaml");
  CHECK(read_settings(document).names == std::vector<std::string>{"c", "d"});
}

TEST_CASE("a text of too many values is refused before it is built, a long one is not") {
  const auto list_of = [](std::size_t size) {
    std::string text = "names: [";
    for (std::size_t i = 0; i < size; ++i) text += "a,\n";
    return text + "]\ntext: " + std::string(1'000'000, 'x') + "\n";
  };
  // The map, two keys, the list and the long text count, too.
  ConfigurationDocument document =
      ConfigurationDocument::from_text(list_of(kValuesMax - 5), "s.yaml");
  CHECK(read_settings(document).text.size() == 1'000'000);
  CHECK_THROWS_WITH(ConfigurationDocument::from_text(list_of(kValuesMax - 4), "s.yaml"),
                    Catch::StartsWith("s.yaml:49998: more than 50000 values, keys and lists"));
}

TEST_CASE(
    "a text that aliases multiply, or whose brackets may still be a key, is refused unbuilt") {
  std::string text = "text: &a " + std::string(100'000, 'b') + "\nnames: [";
  for (int i = 0; i < 30; ++i) text += "*a, ";
  CHECK_THROWS_WITH(ConfigurationDocument::from_text(text + "]\n", "s.yaml"),
                    "s.yaml: aliases (*) make it too large");
  std::string nested = "names: [[";
  for (std::size_t i = 0; i < 5 * kValuesMax; ++i) nested += "a,";
  CHECK_THROWS_WITH(ConfigurationDocument::from_text(nested + "]]\n", "s.yaml"),
                    Catch::StartsWith("s.yaml: more than 200000 commas and opened brackets"));
}

TEST_CASE("all lists of maps together have a bound, too") {
  std::string text = "outer: [";
  for (int i = 0; i < 100; ++i) {
    text += "{inner: [";
    for (int j = 0; j < 100; ++j) text += "{},";
    text += "]},";
  }
  ConfigurationDocument document = ConfigurationDocument::from_text(text + "]\n", "s.yaml");
  std::size_t num_read = 0;
  for (ConfigurationMap& outer : document.root().maps("outer"))
    num_read += outer.maps("inner").size();
  CHECK(num_read < 4096);
  CHECK(num_read > 3000);
  CHECK_THROWS_WITH(document.finish(),
                    Catch::Contains("more than 4096 entries in all lists together"));
}

TEST_CASE("of a list that is too long the first maps are read, and no more is said of the others") {
  std::string text = "points: [";
  for (int i = 0; i < 7; ++i) text += "{x: " + std::to_string(i) + "}, ";
  ConfigurationDocument document = ConfigurationDocument::from_text(text + "]\n", "s.yaml");
  CHECK(document.root().maps("points", 7).size() == 7);
  CHECK(document.root().maps("points", 6).size() == 6);
  CHECK_THROWS_WITH(document.finish(), "s.yaml:1:9: points: has 7 entries, at most 6 are possible");
}

TEST_CASE("a hundred problems are told, and how many more there are") {
  std::string text;
  for (int i = 0; i < 250; ++i) text += "unknown_" + std::to_string(i) + ": 0\n";
  ConfigurationDocument document = ConfigurationDocument::from_text(text, "s.yaml");
  try {
    document.finish();
    FAIL("nothing was refused");
  } catch (const ConfigurationError& error) {
    const std::string told = error.what();
    CHECK(std::count(told.begin(), told.end(), '\n') == 100);
    CHECK(told.find("unknown_99:") != std::string::npos);
    CHECK(told.ends_with("\ns.yaml: and 150 more problems"));
  }
}

TEST_CASE("what the file says is read, and what it leaves out keeps its default") {
  const Settings settings = read_text(
      "variance: 0\nseed: -9223372036854775808\nnum_steps: 0x10\nis_on: false\ntext: \"1: # "
      "x\"\nnames: []\n"
      "attack_probability: 0.25\nmean: [1e3, -.5]\nmatrix: [[1, 2]]\ncolour: red\ninner: "
      "{period_s: 1e-3}\n"
      "items: [{name: x, value: 3}, {name: y}]\n");
  CHECK(settings.variance == 0.0);
  CHECK(settings.seed == std::numeric_limits<std::int64_t>::min());
  CHECK(settings.num_steps == 16);
  CHECK_FALSE(settings.is_on);
  CHECK(settings.text == "1: # x");
  CHECK(settings.names.empty());
  CHECK(settings.attack_probability == std::vector<double>(3, 0.25));
  CHECK(settings.mean == std::vector<double>{1000.0, -0.5});
  CHECK(settings.matrix == std::vector<std::vector<double>>{{1.0, 2.0}});
  CHECK(settings.colour == Colour::kRed);
  CHECK(settings.inner_period_s == 0.001);
  CHECK(std::isinf(settings.open_end_s));
  CHECK(settings.items == std::vector<std::pair<std::string, double>>{{"x", 3.0}, {"y", 0.0}});
  CHECK(read_text("seed:\n").seed == 1);
  CHECK(read_text("{}").num_steps == 100);
}

TEST_CASE("the resolved document says everything, and reads back as itself") {
  const std::string texts[] = {
      "{}",
      "variance: 0.1\nmean: [3.3333333333333335, 1e-300]\nnum_steps: 0x10\nattack_probability: "
      "0.3\n",
      "text: \"two\\nlines: # and 'quotes'\"\nnames: [\"\", \"true\", \"1\", \"~\", \"- x\"]\n",
      "colour: red\ninner: {open_end_s: .inf}\nitems: [{name: x}, {name: \"y: z\", value: -0.0}]\n",
      "matrix: []\nnames: []\nitems: []\n"};
  for (const std::string& text : texts) {
    const std::string once = resolved(text);
    INFO(once);
    CHECK(resolved(once) == once);
    CHECK(once.find("variance: ") != std::string::npos);
    CHECK(once.find("period_s: 0.5") != std::string::npos);
    const Settings a = read_text(text), b = read_text(once);
    CHECK(a.variance == b.variance);
    CHECK(a.text == b.text);
    CHECK(a.names == b.names);
    CHECK(a.mean == b.mean);
    CHECK(a.matrix == b.matrix);
    CHECK(a.items == b.items);
    CHECK(a.colour == b.colour);
  }
  // Numbers are written as people write them.
  CHECK(resolved("variance: 0.1\n").find("variance: 0.1\n") != std::string::npos);
}

TEST_CASE("a map that is read in two places is whole in the resolved document") {
  auto document = ConfigurationDocument::from_text("part: {a: 1, b: 2}\n", "file.yaml");
  int a = 0, b = 0;
  document.root().map("part").read("a", a);
  document.root().map("part").read("b", b);
  document.finish();
  CHECK(document.resolved_text() == "part:\n  a: 1\n  b: 2\n");
}

TEST_CASE("overrides set keys, list items by index or name, and maps that are not there") {
  const std::string text =
      "seed: 1\nitems:\n  - {name: first, value: 1}\n  - {name: second, value: 2}\n";
  CHECK(read_text(text, {"seed=7"}).seed == 7);
  CHECK(read_text(text, {"seed=7", "seed=8"}).seed == 8);
  CHECK(read_text(text, {"text=a=b"}).text == "a=b");
  CHECK(read_text(text, {"mean=[1, 2]"}).mean == std::vector<double>{1.0, 2.0});
  CHECK(read_text(text, {"inner.period_s=3"}).inner_period_s == 3.0);
  CHECK(read_text("inner:\n", {"inner.period_s=3"}).inner_period_s == 3.0);
  CHECK(read_text("mean: [1, 2]\n", {"mean.1=5"}).mean == std::vector<double>{1.0, 5.0});
  using Items = std::vector<std::pair<std::string, double>>;
  CHECK(read_text(text, {"items.1.value=5"}).items == Items{{"first", 1.0}, {"second", 5.0}});
  CHECK(read_text(text, {"items[1].value=5"}).items == Items{{"first", 1.0}, {"second", 5.0}});
  CHECK(read_text(text, {"items.first.value=5"}).items == Items{{"first", 5.0}, {"second", 2.0}});
  CHECK(read_text(text, {"items.0={name: new}"}).items == Items{{"new", 0.0}, {"second", 2.0}});
  CHECK(resolved(text, {"seed=7"}) == resolved("seed: 7\n" + text.substr(8)));
}

TEST_CASE("an override changes its own place, not others that share an anchor with it") {
  const auto number_at = [](const std::string& override_text, const std::string& place,
                            const std::string& key) {
    auto document = ConfigurationDocument::from_text(
        "first: &shared {p: 1, deep: {q: 2}}\nsecond: *shared\nlist: [{name: third, part: "
        "*shared}]",
        "file.yaml", {override_text});
    ConfigurationMap root = document.root();
    ConfigurationMap map = place == "third" ? root.maps("list").at(0).map("part") : root.map(place);
    double value = 0.0;
    if (key == "q") map = map.map("deep");
    map.read(key, value);
    return value;
  };
  for (const std::string changed : {"first", "second", "third"}) {
    const std::string path = changed == "third" ? "list.third.part" : changed;
    for (const std::string place : {"first", "second", "third"}) {
      INFO(changed << " is changed, " << place << " is read");
      CHECK(number_at(path + ".p=5", place, "p") == (place == changed ? 5.0 : 1.0));
      CHECK(number_at(path + ".deep.q=6", place, "q") == (place == changed ? 6.0 : 2.0));
      CHECK(number_at(path + ".deep.q=6", place, "p") == 1.0);
      CHECK(number_at(path + "={p: 7}", place, "p") == (place == changed ? 7.0 : 1.0));
      CHECK(number_at(path + ".p=5", place, "q") == 2.0);
    }
  }
}

TEST_CASE("a wrong override is told as such, not as a place in the file") {
  const std::string text = "seed: 1\nitems:\n  - {name: first, value: 1}\n";
  CHECK(problems(text, {"variance=-1"}) == "--set variance=-1: variance: -1 must be 0 or more");
  CHECK(problems(text, {"seed=2", "sed=7"}) == "--set sed=7: sed: unknown key");
  CHECK(problems(text, {"iner.period_s=7"}) == "--set iner.period_s=7: iner: unknown key");
  CHECK(problems(text, {"items.first.value=x"}) ==
        "--set items.first.value=x: items[0].value: 'x' is no number");
  for (const std::string assignment :
       {"seed", "=3", "seed.x=1", "seed.x.y=1", "items.2.value=1", "items.nobody.value=1",
        "items.-1.value=1", "items.5=1", "a..b=1", "inner.=1", "seed=[1"}) {
    INFO(assignment);
    CHECK_THROWS_AS(read_text(text, {assignment}), UsageError);
    try {
      read_text(text, {assignment});
    } catch (const UsageError& error) {
      CHECK(std::string(error.what()).find("--set " + assignment + ": ") == 0);
    }
  }
}

TEST_CASE("a reader can add problems of its own, and move or forget keys") {
  auto document = ConfigurationDocument::from_text("a: 1\nb: 2\n", "file.yaml");
  ConfigurationMap root = document.root();
  int a = 0, b = 0;
  root.read("a", a);
  root.read("b", b);
  CHECK(root.path("a") == "a");
  root.forget("a");
  root.resolve("b", YAML::Node("both"));
  CHECK(document.resolved_text() == "b: both\n");
  root.problem("b", "does not go with a");
  root.problem("c", "is not there");
  CHECK_THROWS_WITH(document.finish(),
                    "file.yaml:1:1: c: is not there\nfile.yaml:2:4: b: does not go with a");
}

}  // namespace holdfast
