// Whose turn it is: frames in a flood, commands against them.
#include "tools/attacker_process.h"

#include "drivers/sensors/canopen_node.h"
#include "tests/support/catch.h"
#include "tests/unit/tools/experiment/scenario_texts.h"

namespace holdfast {
namespace {

using testing::scenario;

/// Has frames of a stranger for so many reads, and keeps what is written.
class FloodedBus : public CanBus {
 public:
  explicit FloodedBus(int num_reads, const CanFrame& frame) : left_(num_reads), frame_(frame) {}

  int file_descriptor() const override { return -1; }
  std::size_t read(std::span<CanFrame> frames) override {
    if (left_ == 0) return 0;
    --left_;
    frames[0] = frame_;
    return 1;
  }
  std::size_t read_waiting(std::span<CanFrame> frames) override {
    ++num_waits;
    return read(frames);
  }
  std::size_t write(std::span<const CanFrame> frames) override {
    written.insert(written.end(), frames.begin(), frames.end());
    return frames.size();
  }
  const BusCounters& counters() override { return counters_; }

  int num_waits = 0;
  std::vector<CanFrame> written;

 private:
  int left_;
  CanFrame frame_;
  BusCounters counters_;
};

constexpr int kFlood = 14;  // before the clock is looked at
const CanFrame kForeign = canopen_frame(0x7A5, {1, 2, 3});

}  // namespace

TEST_CASE("one way, an attacker waits in its read for as long as frames come") {
  const Experiment experiment = load_experiment(scenario("binary_tracking"));
  AttackerProcess attacker(experiment, "loop:none", nullptr);
  FloodedBus sensors(kFlood, kForeign), monitor(0, kForeign);
  attacker.on_readable(sensors, monitor);
  CHECK(monitor.written.size() == kFlood);
  CHECK(sensors.num_waits == kFlood + 1);
}

TEST_CASE("where commands go back, no flood and no wait for frames delays them") {
  const Experiment experiment = load_experiment(scenario("binary_canopen"));
  AttackerProcess attacker(experiment, "loop:none", nullptr);
  const CanFrame start = canopen_frame(0, {1, 0});
  FloodedBus sensors(kFlood, kForeign), monitor(1, start);
  attacker.on_readable(sensors, monitor);
  CHECK(monitor.written.size() == 1);
  CHECK(sensors.num_waits == 0);
  attacker.on_monitor_readable(sensors, monitor);
  REQUIRE(sensors.written.size() == 1);
  CHECK(sensors.written[0].same_on_wire(start));
  for (int i = 1; i < kFlood; ++i) attacker.on_readable(sensors, monitor);
  CHECK(monitor.written.size() == kFlood);
}

}  // namespace holdfast
