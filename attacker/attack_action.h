#pragma once

#include <string>
#include <vector>

#include "attacker/attack_rule.h"

namespace holdfast {

/// Reads what the rule does, once its name, match and action are known: the keys that its action
/// has. selected: the messages of its match. Problems are reported on the map.
void read_action(ConfigurationMap& map, const std::string& folder, const FrameLayout& layout,
                 const std::vector<const DbcMessage*>& selected, AttackRule& rule);

}  // namespace holdfast
