#pragma once

#include "common/models/binary_target/binary_target_model.h"
#include "estimators/particle_kernel.h"
#include "estimators/particle_set.h"

namespace holdfast {

/// The law of eqs. (2), (3) in the form of the kernels.
DetectionLaw make_detection_law(const BinaryTargetModel& model);

/// q of the law at squared distance d2_m2, by std::erfc.
double detection_probability(const DetectionLaw& law, double d2_m2);

/// q(d2) as a table of cubics, all sensors alike (spec: cells by exponent and top mantissa bits).
///
/// Outside its interval q is constant to 1e-15. Cells are halved until the error half way between
/// the nodes is below kErrorMax. Throws UsageError when 4096 cells per octave do not reach that,
/// the noise being too narrow for q to be smooth within a cell: such a law needs `exact`.
class DetectionTable {
 public:
  static constexpr double kErrorMax = 2e-11;  // absolute, in q

  explicit DetectionTable(const DetectionLaw& law);

  const DetectionTableView& view() const { return view_; }
  int cells_per_octave() const { return 1 << bits_; }
  std::size_t num_cells() const { return num_cells_; }

 private:
  double fill(const DetectionLaw& law);

  int bits_ = 7;
  std::size_t num_cells_ = 0;
  AlignedArray coefficients_;
  DetectionTableView view_;
};

}  // namespace holdfast
