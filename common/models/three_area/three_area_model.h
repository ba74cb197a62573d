#pragma once

#include <array>
#include <string>
#include <vector>

#include "common/configuration.h"
#include "common/models/system_model.h"

namespace holdfast {

/// Keys of a plant or belief of three power areas with tie lines, of paper 004 (method page
/// "multiple_model", section 4, whose reconstruction of the equations this is).
struct ThreeAreaOptions {
  /// What a tie does whose breaker is open.
  enum class OpenTie {
    kZero,   // its power is process noise alone
    kFrozen  // its power stays as it was, but for the noise
  };

  double step_s = 0.1;
  OpenTie open_tie = OpenTie::kZero;
  // Which of the ties 1-2, 2-3, 3-1 are closed, as "111"; a topology each.
  std::vector<std::string> ties = {"111", "010", "001", "100", "000"};
  std::vector<double> process_variance;      // diagonal of Q, [12]; empty: the paper's
  std::vector<double> measurement_variance;  // diagonal of R, [12]; empty: the paper's

  void read(ConfigurationMap& map);
};

/// The three areas with these ties: state (frequency w, mechanical power Pm, valve Pv) of each
/// area, then the powers of the ties 1-2, 2-3, 3-1; all states measured; attack channels "w_1" to
/// "w_3" on the frequency sensors; in continuous time, made discrete exactly,
///
///   Ma dw/dt = -D w - sum of tie powers + Pm     TCH dPm/dt = -Pm + Pv
///   TG dPv/dt = -Pv - w / Rf                     dP_ij/dt = T_ij (w_i - w_j)
///
/// Throws UsageError for a text that is not three of 0 and 1, or a number of wrong size or sign.
SystemModel make_three_area_model(const ThreeAreaOptions& options, const std::string& ties);

}  // namespace holdfast
