#pragma once

#include <string>

namespace holdfast {

/// Gives a running attacker an order over its control socket (docs/attacks.md, "Control while it
/// runs") and prints the answer; "watch" stays until the attacker goes. argument: name of a rule,
/// file of a rule or of rules, or seconds, as the order needs. Returns 0. Throws UsageError for a
/// wrong or refused order, JobError when nobody listens or the attacker goes away.
int send_order(const std::string& path, const std::string& order, const std::string& argument);

}  // namespace holdfast
