#include "common/models/mode_set.h"

#include <algorithm>
#include <numeric>
#include <set>

#include "common/name_list.h"
#include "common/subsets.h"

namespace holdfast {
namespace {

// Indices of names among the known ones; every unknown one is a problem of the key.
std::vector<int> indices_of(ConfigurationMap& map, const char* key, const char* what,
                            const std::vector<std::string>& names,
                            const std::vector<std::string>& known) {
  std::vector<int> indices;
  for (const std::string& name : names) {
    const int index = find_name(map, key, "the " + std::string(what), name, known);
    if (index >= 0) indices.push_back(index);
  }
  std::sort(indices.begin(), indices.end());
  if (std::adjacent_find(indices.begin(), indices.end()) != indices.end()) {
    map.problem(key, "must name each of the " + std::string(what) + " once");
    indices.erase(std::unique(indices.begin(), indices.end()), indices.end());
  }
  return indices;
}

}  // namespace

ModeSet ModeSet::single(SystemModel model) {
  ModeSet set;
  set.topology_names = {"all"};
  std::vector<int> all(static_cast<std::size_t>(model.num_attack_channels()));
  std::iota(all.begin(), all.end(), 0);
  set.topologies.push_back(std::move(model));
  set.modes.push_back({"all", 0, std::move(all)});
  return set;
}

SystemModel ModeSet::model(int mode) const {
  const PlantMode& one = modes[static_cast<std::size_t>(mode)];
  return topologies[static_cast<std::size_t>(one.topology)].with_attack_channels(one.channels);
}

std::vector<SystemModel> ModeSet::models() const {
  std::vector<SystemModel> result;
  for (std::size_t i = 0; i < modes.size(); ++i) result.push_back(model(static_cast<int>(i)));
  return result;
}

std::vector<std::string> ModeSet::names() const {
  std::vector<std::string> result;
  for (const PlantMode& mode : modes) result.push_back(mode.name);
  return result;
}

int ModeSet::find(const std::string& name) const {
  const auto found = std::find_if(modes.begin(), modes.end(),
                                  [&name](const PlantMode& mode) { return mode.name == name; });
  return found == modes.end() ? -1 : static_cast<int>(found - modes.begin());
}

void ModeSet::read(ConfigurationMap& map) {
  if (map.has("modes") && map.has("generated_modes")) {
    map.problem("generated_modes", "give modes or generated_modes, not both");
  }
  if (map.has("modes")) read_list(map);
  if (map.has("generated_modes")) generate(map.map("generated_modes"));
  if (!modes.empty()) return;
  std::vector<int> all(static_cast<std::size_t>(topologies.front().num_attack_channels()));
  std::iota(all.begin(), all.end(), 0);
  for (std::size_t t = 0; t < topologies.size(); ++t) {
    modes.push_back({topology_names[t], static_cast<int>(t), all});
  }
}

void ModeSet::read_list(ConfigurationMap& map) {
  modes.clear();
  std::set<std::string> names;
  const std::vector<std::string>& known = topologies.front().attack_names;
  for (ConfigurationMap& entry : map.maps("modes")) {
    PlantMode mode;
    entry.require("name");
    entry.read("name", mode.name);
    if (!names.insert(mode.name).second) entry.problem("name", "'" + mode.name + "' given twice");
    std::string topology = topology_names.front();
    entry.read("topology", topology);
    const std::vector<int> found =
        indices_of(entry, "topology", "plant's topologies", {topology}, topology_names);
    if (!found.empty()) mode.topology = found.front();
    std::vector<std::string> channels = known;
    entry.read("channels", channels);
    mode.channels = indices_of(entry, "channels", "plant's attack channels", channels, known);
    modes.push_back(std::move(mode));
  }
  if (modes.empty()) map.problem("modes", "must name at least one mode");
  if (modes.size() > kModesMax) {
    map.problem("modes", "at most " + std::to_string(kModesMax) + " modes");
  }
}

void ModeSet::generate(ConfigurationMap map) {
  const std::vector<std::string>& known = topologies.front().attack_names;
  std::vector<std::string> among = known, at = topology_names;
  map.read("among", among);
  map.read("topologies", at);
  const std::vector<int> channels =
      indices_of(map, "among", "plant's attack channels", among, known);
  const std::vector<int> of_topologies =
      indices_of(map, "topologies", "plant's topologies", at, topology_names);
  const auto count = static_cast<double>(channels.size());
  int most = static_cast<int>(channels.size()), least = 0;
  map.read("attacked_most", most, {0.0, count});
  map.read("attacked_least", least, {0.0, count});
  if (least > most) return map.problem("attacked_least", "lies above attacked_most");
  double num_modes = 0.0;
  for (int size = least; size <= most; ++size) {
    num_modes += binomial(static_cast<int>(channels.size()), size);
  }
  if (num_modes * static_cast<double>(of_topologies.size()) > static_cast<double>(kModesMax)) {
    return map.problem("attacked_most", "makes more than " + std::to_string(kModesMax) + " modes");
  }
  modes.clear();
  for (const int topology : of_topologies) {
    const std::string prefix =
        topologies.size() > 1 ? topology_names[static_cast<std::size_t>(topology)] + ":" : "";
    for (int size = least; size <= most; ++size) {
      for_each_subset(
          channels, static_cast<std::size_t>(size), [&](const std::vector<int>& subset) {
            std::string name;
            for (const int channel : subset) {
              name += (name.empty() ? "" : "+") + known[static_cast<std::size_t>(channel)];
            }
            modes.push_back({prefix + (name.empty() ? "none" : name), topology, subset});
          });
    }
  }
  if (modes.empty()) map.problem("topologies", "leave no mode");
  std::set<std::string> names;
  for (const PlantMode& mode : modes) {
    if (!names.insert(mode.name).second)
      map.problem("among", "makes two modes called '" + mode.name + "': list them under modes");
  }
}

}  // namespace holdfast
