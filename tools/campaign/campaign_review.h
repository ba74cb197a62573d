#pragma once

#include <string>
#include <vector>

#include "tools/review_outputs.h"

namespace holdfast {

/// Reviews results files of campaigns and writes what is asked for, tables to standard output. The
/// folder for CSV gets metrics.csv and curves.csv. Throws UsageError for a file that is none.
void review_campaigns(const std::vector<std::string>& files, const ReviewOutputs& outputs);

/// True when the aggregates of two results files are equal, byte for byte; says so on standard
/// output.
bool compare_campaigns(const std::string& one, const std::string& other);

}  // namespace holdfast
