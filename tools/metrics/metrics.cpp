#include "tools/metrics/metrics.h"
