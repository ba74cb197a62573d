#include "tests/unit/estimators/multiple_model/golden_modes.h"

namespace holdfast {
namespace {}  // namespace
}  // namespace holdfast
