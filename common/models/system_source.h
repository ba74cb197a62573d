#pragma once

#include <string>
#include <vector>

#include "common/models/ieee14/ieee14_model.h"
#include "common/models/mode_set.h"
#include "common/models/system_model.h"
#include "common/models/three_area/three_area_model.h"
#include "common/models/turning_target/turning_target_model.h"

namespace holdfast {

/// Where a SystemModel of a scenario comes from: matrices in the file, or a model that comes with
/// Holdfast. A plant has one as truth; an estimator starts from the plant's and reads its own over
/// it as belief.
struct SystemSource {
  enum class Kind { kLinear, kIeee14, kTurningTarget, kThreeArea };

  Kind kind = Kind::kLinear;
  Ieee14Options ieee14;                 // of kIeee14
  TurningTargetOptions turning_target;  // of kTurningTarget
  ThreeAreaOptions three_area;          // of kThreeArea
  SystemModel model;                    // what follows; of the first topology
  // All topologies, and the modes that take turns; modes are read apart, by ModeSet::read().
  ModeSet modes;

  /// Names of the kinds, as they stand in scenarios.
  static const std::vector<std::string>& kind_names();
  /// False when no kind has that name.
  bool set_kind(const std::string& name);

  /// Reads the keys of the kind over the values that stand and makes the model. The resolved
  /// document holds its matrices as numbers. Of a linear model `topologies`, a list of {name, A, C,
  /// ...}, replaces matrices of the model in one topology each.
  void read(ConfigurationMap map);
  /// States that belong together, with their unit: {name, states, unit} of each group.
  struct Group {
    std::string name;
    std::vector<int> states;
    std::string unit;
  };
  std::vector<Group> groups() const;

 private:
  void set_topologies(ConfigurationMap& map, const SystemModel& model_before);
};

}  // namespace holdfast
