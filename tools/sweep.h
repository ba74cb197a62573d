#pragma once

#include <string>
#include <vector>

#include "common/configuration.h"

namespace holdfast {

/// One key of the scenario and the values that it takes.
struct SweepAxis {
  std::string key;                  // path, as --set takes it
  std::vector<std::string> values;  // YAML, on one line each
};

/// Variations of a scenario: every combination of the grid's values, then each listed point.
struct Sweep {
  std::vector<SweepAxis> grid;
  std::vector<std::vector<std::string>> list;  // "key=value" assignments of each point

  bool is_empty() const { return grid.empty() && list.empty(); }
  /// Assignments of each point, in order: the grid's last key changes fastest. One point without
  /// any assignment when the sweep is empty.
  std::vector<std::vector<std::string>> points() const;
};

/// Reads `grid: {path: [values]}` and `list: [{path: value}]` below a key of a scenario.
Sweep read_sweep(ConfigurationMap& map, const std::string& key);

/// Reads "path=v1,v2,[..],.."; throws UsageError.
SweepAxis parse_sweep_axis(const std::string& text);

/// Reads "path=value; path=value"; throws UsageError.
std::vector<std::string> parse_sweep_point(const std::string& text);

/// "a=1, b=2"; "" for no assignment.
std::string sweep_label(const std::vector<std::string>& assignments);

}  // namespace holdfast
