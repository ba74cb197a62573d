#pragma once

#include <string>
#include <vector>

#include "attacker/proxy_core.h"
#include "tools/experiment.h"

namespace holdfast {

/// The rules of a running attacker, as whoever controls it sees and changes them (docs/attacks.md,
/// "Control while it runs"). Each change is checked as a scenario is, and then holds at once and
/// whole, or not at all.
class RuleBook {
 public:
  /// Both must outlive it.
  RuleBook(const Experiment& experiment, ProxyCore& core);

  /// Answers one request, a JSON object; the answer is one, too, on one line. watch_s: set when the
  /// client asks to be watched, to how long it may be silent; 0: not watched.
  std::string answer(const std::string& request, double& watch_s);
  /// No rule acts any more until somebody resumes them. False when none did already.
  bool pause_all();

 private:
  // Text, since copies of a YAML::Node are one node.
  struct Entry {
    std::string name, text;
    bool is_paused = false;
  };
  using Entries = std::vector<Entry>;

  void adopt(Entries entries);
  std::size_t find(const Entries& entries, const std::string& name) const;
  Entries changed(const std::string& what, const std::string& name, const std::string& text) const;
  static Entry entry_of(const std::string& text);
  static Entries list_of(const std::string& text);
  std::string state_text(bool with_rules) const;

  const Experiment& experiment_;
  ProxyCore& core_;
  Entries entries_;
};

}  // namespace holdfast
