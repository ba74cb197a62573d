#include "common/configuration_override.h"

#include <charconv>
#include <vector>

#include "common/errors.h"

namespace holdfast {
namespace {

std::vector<std::string> split_path(const std::string& path) {
  std::vector<std::string> keys{""};
  for (const char c : path) {
    if (c == ']') continue;
    if (c == '.' || c == '[') {
      keys.emplace_back();
    } else {
      keys.back() += c;
    }
  }
  return keys;
}

YAML::Node undefined() {
  return YAML::Node(YAML::NodeType::Undefined);
}

YAML::Node list_item(const YAML::Node& list, const std::string& key) {
  for (const auto& item : list) {
    if (item.IsMap() && item["name"] && item["name"].Scalar() == key) return item;
  }
  std::size_t index = 0;
  const char* end = key.data() + key.size();
  const auto [stop, error] = std::from_chars(key.data(), end, index);
  return error == std::errc() && stop == end && index < list.size() ? list[index] : undefined();
}

// Steps down without making anything: yaml-cpp's operator[] on a node that is not const would.
YAML::Node descend(const YAML::Node& parent, const std::string& key) {
  if (parent.IsSequence()) return list_item(parent, key);
  if (!parent.IsMap()) return undefined();
  const YAML::Node below = parent[key];
  return below.IsDefined() ? below : undefined();
}

// How often a node stands in a document: an alias is the anchor's own node, in another place.
int count_places(const YAML::Node& tree, const YAML::Node& node) {
  int count = tree.is(node) ? 1 : 0;
  for (const auto& entry : tree) count += count_places(tree.IsMap() ? entry.second : entry, node);
  return count;
}

// Gives a map's entry a node of its own where it shares one, so that what is set below it is set in
// this place only.
void unshare(const YAML::Node& root, YAML::Node parent, const std::string& key) {
  if (!parent.IsMap() || !descend(parent, key).IsDefined()) return;
  const YAML::Node shared = descend(parent, key);
  if (count_places(root, shared) < 2) return;
  YAML::Node own(shared.Type());
  if (shared.IsScalar()) own = shared.Scalar();
  for (const auto& entry : shared) {
    if (shared.IsMap()) {
      own[entry.first] = entry.second;
    } else {
      own.push_back(entry);
    }
  }
  parent.remove(key);
  parent[key] = own;
}

}  // namespace

void apply_override(const YAML::Node& root, const std::string& assignment, int line) {
  const auto refuse = [&assignment](const std::string& why) {
    throw UsageError("--set " + assignment + ": " + why);
  };
  const auto equals = assignment.find('=');
  if (equals == std::string::npos || equals == 0) refuse("write it as path.to.key=value");
  const std::vector<std::string> keys = split_path(assignment.substr(0, equals));
  YAML::Node value;
  try {
    value = YAML::Load(std::string(static_cast<std::size_t>(line), '\n') +
                       assignment.substr(equals + 1));
  } catch (const YAML::Exception& error) {
    refuse("the value is not YAML: " + error.msg);
  }
  // A node is assigned by reset(), since operator= would write through into the tree.
  YAML::Node at = root;
  for (std::size_t i = 0; i < keys.size(); ++i) {
    if (keys[i].empty()) refuse("a key is empty");
    const bool is_last = i + 1 == keys.size();
    unshare(root, at, keys[i]);
    YAML::Node next = descend(at, keys[i]);
    if (!at.IsMap() && !next.IsDefined()) {
      refuse(at.IsSequence() ? "the list has no item '" + keys[i] + "'"
                             : "'" + keys[i - 1] + "' is neither a map nor a list");
    }
    if (is_last && at.IsMap()) {
      at[keys[i]] = value;
    } else if (is_last) {
      next = value;
    } else {
      if (!next.IsDefined() || next.IsNull()) {
        at[keys[i]] = YAML::Node(YAML::NodeType::Map);
        next.reset(at[keys[i]]);
      }
      at.reset(next);
    }
  }
}

}  // namespace holdfast
