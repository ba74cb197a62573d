#include <cmath>
#include <optional>
#include <random>
#include <set>
#include <vector>

#include "drivers/can/dbc.h"
#include "tests/support/catch.h"
#include "tests/support/texts.h"

namespace holdfast {
namespace {

// Ends, since no selector is met twice.
int num_selectors_above(const DbcMessage& message, const DbcSignal& signal) {
  int count = 0;
  for (const DbcSignal* at = message.selector_of(signal); at != nullptr;) {
    REQUIRE(at->is_selector);
    REQUIRE(at->kind != DbcSignal::Kind::kFloat32);
    REQUIRE(at->kind != DbcSignal::Kind::kFloat64);
    REQUIRE(++count <= static_cast<int>(message.signals.size()));
    at = message.selector_of(*at);
  }
  return count;
}

// What holds for every result, whatever the bytes were; uses each signal, so that a sanitizer sees
// an access outside.
void check_invariants(const Dbc& dbc) {
  std::set<std::pair<std::uint32_t, bool>> identifiers;
  for (const DbcMessage& message : dbc.messages) {
    REQUIRE(identifiers.emplace(message.identifier, message.is_extended).second);
    CanFrame frame = message.empty_frame();
    REQUIRE(is_valid(frame));
    REQUIRE(message.matches(frame));
    const std::vector<bool> is_carried = message.carried_signals(frame.bytes());
    for (std::size_t i = 0; i < message.signals.size(); ++i)
      REQUIRE(is_carried.at(i) == message.carries(message.signals[i], frame.bytes()));
    for (const DbcSignal& signal : message.signals) {
      REQUIRE(signal.fits(message.num_bytes));
      REQUIRE(std::isfinite(signal.scale));
      REQUIRE(signal.scale != 0.0);
      signal.pack({frame.data.data(), frame.num_bytes}, 1.0);
      signal.unpack(frame.bytes());
      message.carries(signal, frame.bytes());
      const std::optional<CanFrame> with_signal = message.frame_for({signal});
      if (with_signal) REQUIRE(message.carries(signal, with_signal->bytes()));
      REQUIRE(with_signal.has_value() + num_selectors_above(message, signal) > 0);
    }
  }
  int line = 1;
  for (const DbcProblem& problem : dbc.problems) {
    REQUIRE(problem.line >= line);
    REQUIRE(problem.column >= 1);
    line = problem.line;
  }
}

std::string mutated(std::string text, std::mt19937& generator) {
  static const std::string kSpice[] = {"\"",
                                       ";",
                                       "\n",
                                       "BO_ ",
                                       "SG_ ",
                                       "VAL_ ",
                                       "CM_ \"",
                                       "M",
                                       "m0",
                                       "m1M",
                                       "@",
                                       "|",
                                       "-1",
                                       "99999999999999999999",
                                       "1e999",
                                       std::string(1, '\0'),
                                       "\xFF",
                                       ":",
                                       "SG_MUL_VAL_ ",
                                       "SIG_VALTYPE_ ",
                                       "BA_ \"VFrameFormat\" BO_ ",
                                       "\\\"",
                                       "NS_ :\n",
                                       "\r"};
  const int num_changes = 1 + static_cast<int>(generator() % 8U);
  for (int i = 0; i < num_changes && !text.empty(); ++i) {
    const std::size_t at = generator() % text.size();
    switch (generator() % 5U) {
      case 0:
        text[at] = static_cast<char>(generator());
        break;
      case 1:
        text.erase(at, 1 + generator() % 30U);
        break;
      case 2:
        text.insert(at, kSpice[generator() % std::size(kSpice)]);
        break;
      case 3:
        text.insert(at, text.substr(generator() % text.size(), generator() % 60U));
        break;
      default:
        text.resize(at + 1);
        break;
    }
  }
  return text;
}

TEST_CASE("no bytes make the DBC reader throw or give a signal outside its message") {
  const std::string awkward = testing::file_text("tests/support/dbc_files/awkward.dbc");
  REQUIRE(awkward.size() > 1000);
  const std::string nested = testing::file_text("tests/support/dbc_files/nested.dbc");
  std::mt19937 generator(1);
  std::size_t num_kept = 0, num_problems = 0;
  for (int round = 0; round < 3000; ++round) {
    check_invariants(parse_dbc(mutated(nested, generator)));
    const Dbc dbc = parse_dbc(mutated(awkward, generator));
    check_invariants(dbc);
    num_kept += dbc.messages.size();
    num_problems += dbc.problems.size();
  }
  // The loop means something: most files still hold messages, and most have problems.
  CHECK(num_kept > 10000);
  CHECK(num_problems > 3000);
}

TEST_CASE("every beginning of a file is read without harm") {
  const std::string awkward = testing::file_text("tests/support/dbc_files/awkward.dbc");
  for (std::size_t size = 0; size < awkward.size(); size += 3)
    check_invariants(parse_dbc(awkward.substr(0, size)));
}

TEST_CASE("random bytes and random words are read without harm") {
  std::mt19937 generator(2);
  const std::string alphabet = "BOSGVALCM_ 0189:|@+-(),[]\"\n;\\.eMm\t";
  for (int round = 0; round < 2000; ++round) {
    std::string bytes(generator() % 400U, ' ');
    for (char& c : bytes) {
      c = round % 2 == 0 ? static_cast<char>(generator()) : alphabet[generator() % alphabet.size()];
    }
    check_invariants(parse_dbc(bytes));
  }
}

}  // namespace
}  // namespace holdfast
