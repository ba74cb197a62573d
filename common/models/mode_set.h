#pragma once

#include <string>
#include <vector>

#include "common/configuration.h"
#include "common/models/system_model.h"

namespace holdfast {

/// One discrete hypothesis about a plant: how it is connected, and which channels are attacked.
struct PlantMode {
  std::string name;
  int topology = 0;
  std::vector<int> channels;  // attack channels that may act; ascending
};

/// The modes that a plant can be in, or that an estimator believes in.
struct ModeSet {
  /// Modes beyond this number are refused: a bank has a filter of some 200 KB for each.
  static constexpr std::size_t kModesMax = 1024;

  // The plant's equations in each topology, all channels included; at least one once read.
  std::vector<SystemModel> topologies;
  std::vector<std::string> topology_names;
  std::vector<PlantMode> modes;

  /// A plant that has one mode only, in which all its channels may act.
  static ModeSet single(SystemModel model);
  /// Equations of a mode: its topology with its channels only.
  SystemModel model(int mode) const;
  std::vector<SystemModel> models() const;
  std::vector<std::string> names() const;
  /// Index of the mode of that name, -1 when there is none.
  int find(const std::string& name) const;

  /// Reads over the modes that stand: `modes`, a list of {name, topology, channels}, or
  /// `generated_modes`: every set of attacked_least to attacked_most of the channels `among`, times
  /// `topologies`. Where neither is given and none stands: one mode for each topology, with all
  /// channels.
  void read(ConfigurationMap& map);

 private:
  void read_list(ConfigurationMap& map);
  void generate(ConfigurationMap map);
};

}  // namespace holdfast
