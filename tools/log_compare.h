#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace holdfast {

struct CompareOptions {
  std::string channels =
      "EST_.*";  // regular expression (ECMAScript) that a whole channel name must match
  std::size_t differences_max = 10;  // told one by one, at most 3 of one message
};

/// One field that is not the same in both logs.
struct FieldDifference {
  std::string channel;
  std::int64_t step = 0;
  std::string field;             // such as "mean[0]" or "packets[3].values[0]"
  std::string value_a, value_b;  // numbers with 17 digits
};

struct CompareResult {
  bool is_equal = false;
  std::int64_t compared = 0;   // messages that stand in both logs
  std::int64_t differing = 0;  // of these
  std::map<std::string, std::int64_t> compared_by_channel;
  std::vector<FieldDifference> differences;  // the first ones
  std::vector<std::string> problems;         // why the logs are not equal, other than fields
  std::vector<std::string> notes;            // worth knowing, but no difference

  std::string text() const;
};

/// Compares two logs message by message, joined by channel, step, and order within a step.
///
/// Every field counts, doubles by their bits, but for what must differ between two runs of one
/// seed: seq, measurement_seq, receive_utime and the bus URL. RUN_META, TIMING_* and STATUS_* are
/// left out whatever the expression says. An estimator that sees clean measurements may stand in
/// one log only, since no live run has it; any other channel may not. Nothing compared is not
/// equal. Throws UsageError for a file that cannot be read and for a wrong expression.
CompareResult compare_logs(const std::string& file_a, const std::string& file_b,
                           const CompareOptions& options = {});

}  // namespace holdfast
