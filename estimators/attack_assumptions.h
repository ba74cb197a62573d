#pragma once

#include <cstdint>
#include <vector>

#include "estimators/attack_statistics.h"
#include "estimators/baseline_options.h"

namespace holdfast {

/// What a filter believes of attacks on its readings, step by step: keys of the block `assumes`.
struct AttackAssumptions {
  /// One set of beliefs and the step from which it holds.
  struct Period {
    std::int64_t first_step = 1;
    double attack_probability = 0.3;
    double dos_probability = 0.1;
    double bias_probability = 0.3;
    GaussianOptions bias{{}, {1.0}, {}};  // a [l]
    double scale_probability = 0.1;
    double scale_mean = 1.0, scale_std = 0.1;

    void read(ConfigurationMap& map, int num_measurements);
    /// Throws UsageError when the bias does not have num_measurements components.
    AttackStatistics statistics(int num_measurements) const;
    void set(const AttackStatistics& statistics);
  };

  std::vector<Period> periods = {Period()};  // by first_step; the first one holds from step 1

  /// Reads the first period, and the later ones from the list `changes`: each repeats what stood
  /// before it, except for the keys that it gives.
  void read(ConfigurationMap map, int num_measurements);
};

/// What holds at each step, of values that are made once per period.
template <class Value>
class PeriodSchedule {
 public:
  void add(std::int64_t first_step, Value value) {
    first_steps_.push_back(first_step);
    values_.push_back(std::move(value));
  }
  /// Precondition: add() was called with ascending steps.
  void begin_step(std::int64_t step) {
    now_ = 0;
    while (now_ + 1 < values_.size() && first_steps_[now_ + 1] <= step) ++now_;
  }
  Value& now() { return values_[now_]; }
  const Value& now() const { return values_[now_]; }

 private:
  std::vector<std::int64_t> first_steps_;
  std::vector<Value> values_;
  std::size_t now_ = 0;
};

}  // namespace holdfast
