#include "common/step_window.h"

#include <algorithm>
#include <cmath>

namespace holdfast {

bool StepWindow::contains(std::int64_t step, double step_s) const {
  // Decimal periods are not exact in binary: 3 x 0.1 must still count as 0.3.
  const double time_s = static_cast<double>(step) * step_s;
  const double slack_s = 1e-6 * step_s;
  return step >= first_step && step <= last_step && time_s >= from_s - slack_s &&
         time_s <= to_s + slack_s;
}

std::int64_t StepWindow::first(double step_s) const {
  return std::max(first_step, static_cast<std::int64_t>(std::ceil(from_s / step_s - 1e-6)));
}

void StepWindow::read(ConfigurationMap map) {
  constexpr Interval kSteps{1.0, static_cast<double>(kLastStep)};
  map.read("first_step", first_step, kSteps);
  map.read("last_step", last_step, kSteps);
  map.read("from_s", from_s, {0.0, std::numeric_limits<double>::max()});
  map.read("to_s", to_s, kNonNegative);
  if (last_step < first_step) map.problem("last_step", "lies before first_step");
  if (to_s < from_s) map.problem("to_s", "lies before from_s");
}

}  // namespace holdfast
