// libFuzzer target: rules of a scenario are refused with a ConfigurationError, or they load; then
// the resolved document loads to the same, and a proxy with them loses and makes no frame unseen.

#include <array>
#include <string>
#include <vector>

#include "attacker/proxy_core.h"
#include "tests/fuzz/support.h"

namespace holdfast {
namespace {

using fuzzing::must;

constexpr std::size_t kSteps = 6;

std::vector<AttackRule> rules_of(const std::string& text, const FrameLayout& layout,
                                 std::string& resolved) {
  ConfigurationDocument document = ConfigurationDocument::from_text(text, "rules");
  std::vector<AttackRule> rules = read_attack_rules(document.root(), layout);
  document.finish();
  resolved = document.resolved_text();
  return rules;
}

void check_way(const ProxyCounters& counters, const std::vector<CanFrame>& frames,
               const std::vector<AttackRecord>& records, std::size_t num_rules) {
  must(counters.balance() && counters.sent == static_cast<std::int64_t>(frames.size()));
  std::array<std::int64_t, AttackRecord::kNumDispositions> told{};
  for (const AttackRecord& record : records) {
    ++told[static_cast<std::size_t>(record.disposition)];
    must(record.rule < num_rules && record.tx_index < counters.sent);
    if (record.tx_index < 0) continue;
    must(frames[static_cast<std::size_t>(record.tx_index)].same_on_wire(record.forwarded));
  }
  must(told == std::array{counters.altered, counters.dropped, counters.injected,
                          counters.duplicated, counters.held, counters.released});
  for (const CanFrame& frame : frames) must(is_valid(frame));
}

void run(const std::vector<AttackRule>& rules, const FrameLayout& layout,
         const std::vector<std::vector<CanFrame>>& steps) {
  ProxyCore core(rules, layout, 1, 0, 0.5);
  ProxyOutput out;
  for (const std::vector<CanFrame>& frames : steps) {
    for (const CanFrame& frame : frames) {
      core.on_frame(frame, out);
      core.on_monitor_frame(frame, out);
    }
  }
  must(core.current_step() == kSteps + 1);
  check_way(core.counters(), out.frames, out.records, rules.size());
  check_way(core.command_counters(), out.commands, out.command_records, rules.size());
  must(core.counters().held + core.command_counters().held ==
       core.counters().released + core.command_counters().released +
           static_cast<std::int64_t>(core.num_held()));
}

}  // namespace
}  // namespace holdfast

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace holdfast;
  static const FrameLayout layout = fuzzing::layout_of("plain");
  static const auto steps = fuzzing::frames_of_steps(layout, kSteps);
  std::string resolved, again;
  std::vector<AttackRule> rules;
  try {
    rules = rules_of(std::string(fuzzing::text_of(data, size)), layout, resolved);
  } catch (const ConfigurationError&) {
    return 0;
  }
  must(rules_of(resolved, layout, again).size() == rules.size() && again == resolved);
  run(rules, layout, steps);
  return 0;
}
