#include "tests/unit/attacker/proxy_bench.h"

#include <algorithm>

namespace holdfast::test {

FrameLayout test_layout() {
  FrameLayout layout;
  layout.dbc = parse_dbc(R"dbc(VERSION ""
BU_: Node

BO_ 257 Flag1: 3 Node
 SG_ DETECT : 0|1@1+ (1,0) [0|1] "" Node
 SG_ STEP : 8|16@1+ (1,0) [0|65535] "" Node

BO_ 258 Flag2: 3 Node
 SG_ DETECT : 0|1@1+ (1,0) [0|1] "" Node
 SG_ STEP : 8|16@1+ (1,0) [0|65535] "" Node

BO_ 259 Flag3: 3 Other
 SG_ DETECT : 0|1@1+ (1,0) [0|1] "" Node
 SG_ STEP : 8|16@1+ (1,0) [0|65535] "" Node

BO_ 288 Level: 8 Other
 SG_ LEVEL : 0|32@1- (1,0) [0|0] "m" Node
 SG_ STEP : 32|16@1+ (1,0) [0|65535] "" Node

BO_ 304 Mux: 4 Node
 SG_ WHICH M : 0|8@1+ (1,0) [0|255] "" Node
 SG_ A m1 : 8|8@1+ (1,0) [0|255] "" Node
 SG_ B m2 : 8|8@1+ (1,0) [0|255] "" Node

BO_ 336 Nested: 4 Gate
 SG_ PAGE M : 0|4@1+ (1,0) [0|15] "" Node
 SG_ PART m1M : 4|4@1+ (1,0) [0|15] "" Node
 SG_ DEEP m2 : 8|8@1+ (1,0) [0|255] "" Node
 SG_ DEEPER m3 : 16|8@1+ (1,0) [0|255] "" Node
 SG_ TOP m0 : 8|8@1+ (1,0) [0|255] "" Node

BO_ 2566848513 Wide: 8 Node
 SG_ STATE : 0|2@1+ (1,0) [0|3] "" Node
 SG_ STEP : 8|16@1+ (1,0) [0|65535] "" Node

BO_ 320 Pair: 10 Other
 SG_ LEFT : 0|32@1- (1,0) [0|0] "m" Node
 SG_ RIGHT : 32|32@1- (1,0) [0|0] "m" Node
 SG_ STEP : 64|16@1+ (1,0) [0|65535] "" Node

BO_ 2032 StepTick: 2 Node
 SG_ STEP : 0|16@1+ (1,0) [0|65535] "" Node

SG_MUL_VAL_ 336 DEEP PART 2-3;
SG_MUL_VAL_ 336 DEEPER PART 3-3;
SIG_VALTYPE_ 288 LEVEL : 1;
SIG_VALTYPE_ 320 LEFT : 1;
SIG_VALTYPE_ 320 RIGHT : 1;
)dbc");
  layout.messages = {"Flag1", "Flag2", "Flag3"};
  layout.signals = {"DETECT"};
  layout.counter_signal = "STEP";
  return layout;
}

std::string pair_rule(const std::string& rest) {
  return "attacks: [{name: r, match: {messages: [Pair]}, " + rest + "}]";
}

std::vector<AttackRule> rules_of(const std::string& yaml, const FrameLayout& layout) {
  ConfigurationDocument document = ConfigurationDocument::from_text(yaml, "test.yaml");
  std::vector<AttackRule> rules = read_attack_rules(document.root(), layout);
  document.finish();
  return rules;
}

std::string problems_of(const std::string& yaml, const FrameLayout& layout) {
  try {
    rules_of(yaml, layout);
  } catch (const ConfigurationError& error) {
    return error.what();
  }
  return "";
}

CanFrame reading(const std::string& message, std::int64_t step, const std::string& signal,
                 double value) {
  static const FrameLayout layout = test_layout();
  const DbcMessage& found = *layout.dbc.find(message);
  CanFrame frame = found.empty_frame();
  const std::span<std::uint8_t> data(frame.data.data(), frame.num_bytes);
  if (const DbcSignal* counter = found.find("STEP"))
    counter->set_raw(data, static_cast<std::uint64_t>(step));
  if (!signal.empty()) found.find(signal)->pack(data, value);
  return frame;
}

CanFrame tick(std::int64_t step) {
  return reading("StepTick", step, "", 0.0);
}

double value_of(const CanFrame& frame, const std::string& signal) {
  static const FrameLayout layout = test_layout();
  const DbcMessage* message = layout.dbc.find(frame.identifier, frame.has(CanFrame::kExtended));
  return message->find(signal)->unpack(frame.bytes());
}

Outcome run_proxy(const std::vector<AttackRule>& rules, const std::vector<CanFrame>& frames,
                  std::uint64_t seed, std::uint32_t run, double step_s) {
  ProxyCore proxy(rules, test_layout(), seed, run, step_s);
  Outcome outcome;
  ProxyOutput out;
  for (const CanFrame& frame : frames) proxy.on_frame(frame, out);
  outcome.sent = std::move(out.frames);
  outcome.records = std::move(out.records);
  outcome.counters = proxy.counters();
  return outcome;
}

std::vector<CanFrame> steps_of(int num_steps,
                               const std::function<std::vector<CanFrame>(int)>& frames) {
  std::vector<CanFrame> all;
  for (int step = 1; step <= num_steps; ++step) {
    const std::vector<CanFrame> of_step = frames(step);
    all.insert(all.end(), of_step.begin(), of_step.end());
    all.push_back(tick(step));
  }
  return all;
}

bool same_frames(const std::vector<CanFrame>& a, const std::vector<CanFrame>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const CanFrame& x, const CanFrame& y) { return x.same_on_wire(y); });
}

}  // namespace holdfast::test
