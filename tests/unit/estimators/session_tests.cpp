#include "estimators/estimator_session.h"
#include "tests/support/catch.h"

namespace holdfast {
namespace {

// Remembers what it was asked.
class RecordingEstimator : public Estimator {
 public:
  const Estimate& step(std::int64_t step, const MeasurementSet& set,
                       const Eigen::VectorXd&) override {
    steps.push_back(step);
    num_packets.push_back(set.packets.size());
    estimate_.step = step;
    estimate_.utime = set.utime;
    return estimate_;
  }
  std::vector<std::int64_t> steps;
  std::vector<std::size_t> num_packets;

 private:
  Estimate estimate_;
};

MeasurementSet set_of(std::int64_t step) {
  MeasurementSet set;
  set.clear(step, step * 1'000'000);
  const double value = 1.0;
  set.add({}, {&value, 1});
  return set;
}

}  // namespace

TEST_CASE("a session takes missing steps without packets and ignores old and forged ones") {
  RecordingEstimator estimator;
  EstimatorSession session(estimator, 10, 1.0);
  std::vector<std::int64_t> utimes;
  const auto take = [&utimes](const Estimate& estimate) { utimes.push_back(estimate.utime); };
  session.on_set(set_of(1), take);
  session.on_set(set_of(4), take);
  session.on_set(set_of(2), take);                  // came late
  session.on_set(set_of(4), take);                  // came twice
  session.on_set(set_of(1'000'000'000'000), take);  // forged
  session.on_set(set_of(-3), take);
  session.on_set(set_of(5), take);
  CHECK(estimator.steps == std::vector<std::int64_t>{1, 2, 3, 4, 5});
  CHECK(estimator.num_packets == std::vector<std::size_t>{1, 0, 0, 1, 1});
  CHECK(utimes == std::vector<std::int64_t>{1'000'000, 2'000'000, 3'000'000, 4'000'000, 5'000'000});
  CHECK(session.counters().steps == 5);
  CHECK(session.counters().missing_steps == 2);
  CHECK(session.counters().old_sets == 2);
  CHECK(session.counters().beyond_end == 2);
  CHECK_FALSE(session.is_finished());
  session.on_set(set_of(10), take);
  CHECK(session.is_finished());
}

}  // namespace holdfast
