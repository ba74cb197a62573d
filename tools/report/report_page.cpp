#include "tools/report/report_page.h"
