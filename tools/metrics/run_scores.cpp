#include "tools/metrics/run_scores.h"
