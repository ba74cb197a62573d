#include "drivers/measurement_assembler.h"

#include <cmath>
#include <random>

#include "tests/support/catch.h"
#include "tests/unit/drivers/codec/sensors_layout.h"

namespace holdfast {
namespace {

std::int64_t accounted(const AssemblerCounters& c) {
  return c.packets + c.unknown + c.wrong_format + c.non_finite + c.wrong_checksum +
         c.wrong_counter + c.ticks + c.odd_ticks + c.after_end;
}

CanFrame reading(const FrameCodec& codec, int source, double bit, std::int64_t step,
                 std::int64_t time_ns = 0) {
  CanFrame frame = codec.encode(source, std::vector<double>{bit}, step);
  frame.receive_time_ns = time_ns;
  return frame;
}

AssemblerOptions options_of(std::int64_t num_steps, double step_s = 1.0) {
  AssemblerOptions options;
  options.num_steps = num_steps;
  options.step_s = step_s;
  return options;
}

TEST_CASE("a tick closes the step with every packet in order of arrival, duplicates kept") {
  const FrameCodec codec(small_layout());
  MeasurementAssembler assembler(codec, options_of(2, 0.25));
  CHECK(assembler.current_step() == 1);
  CHECK(assembler.on_frame(reading(codec, 2, 1.0, 1, 5'000'999)) == nullptr);
  CanFrame foreign;
  foreign.identifier = 5;
  CHECK(assembler.on_frame(foreign) == nullptr);
  CHECK(assembler.on_frame(reading(codec, 0, 0.0, 1)) == nullptr);
  CHECK(assembler.on_frame(reading(codec, 2, 0.0, 1)) == nullptr);
  const MeasurementSet* first = assembler.on_frame(codec.encode_tick(1));
  REQUIRE(first != nullptr);
  CHECK(first->step == 1);
  CHECK(first->utime == 250000);
  CHECK(first->seq == 0);
  REQUIRE(first->packets.size() == 3);
  CHECK(first->values == std::vector<double>{1.0, 0.0, 0.0});
  CHECK(first->packets[0].source == 2);
  CHECK(first->packets[0].rx_index == 0);
  CHECK(first->packets[0].receive_utime == 5000);
  CHECK(first->packets[0].step_counter == 1);
  CHECK(first->packets[1].source == 0);
  CHECK(first->packets[1].rx_index == 2);  // the unknown frame was counted
  CHECK(first->packets[2].source == 2);
  CHECK(first->packets[2].rx_index == 3);
  CHECK(first->packets[2].first_value == 2);
  CHECK_FALSE(assembler.is_finished());

  const MeasurementSet* second = assembler.on_frame(codec.encode_tick(2));
  REQUIRE(second != nullptr);
  CHECK(second->step == 2);
  CHECK(second->utime == 500000);
  CHECK(second->seq == 1);
  CHECK(second->packets.empty());
  CHECK(assembler.is_finished());
  CHECK(assembler.on_frame(codec.encode_tick(3)) == nullptr);
  CHECK(assembler.on_frame(reading(codec, 0, 0.0, 3)) == nullptr);
  CHECK(assembler.close_step() == nullptr);
  CHECK(assembler.counters().after_end == 2);
  CHECK(assembler.counters().sets == 2);
  CHECK(assembler.counters().ticks == 2);
  CHECK(accounted(assembler.counters()) == assembler.counters().frames);
}

TEST_CASE("the time of a step is rounded to the microsecond") {
  const FrameCodec codec(small_layout());
  MeasurementAssembler assembler(codec, options_of(0, 1.0 / 3.0));
  CHECK(assembler.on_frame(codec.encode_tick(1))->utime == 333333);
  CHECK(assembler.on_frame(codec.encode_tick(2))->utime == 666667);
}

TEST_CASE("a tick that is not the next one is counted and ignored") {
  const FrameCodec codec(small_layout());
  MeasurementAssembler assembler(codec, options_of(0));
  for (const std::int64_t step : {0, 2, 3, 255, 65535})
    CHECK(assembler.on_frame(codec.encode_tick(step)) == nullptr);
  CHECK(assembler.on_frame(codec.encode_tick(1)) != nullptr);
  CHECK(assembler.on_frame(codec.encode_tick(1)) == nullptr);
  CHECK(assembler.counters().odd_ticks == 6);
  CHECK(assembler.current_step() == 2);
}

TEST_CASE("a counter of another step is dropped, unless it is to be ignored") {
  const FrameCodec codec(small_layout());
  AssemblerOptions options = options_of(0);
  MeasurementAssembler strict(codec, options);
  options.check_counter = false;
  MeasurementAssembler tolerant(codec, options);
  for (MeasurementAssembler* assembler : {&strict, &tolerant}) {
    assembler->on_frame(reading(codec, 0, 1.0, 7));
    assembler->on_frame(reading(codec, 1, 0.0, 1));
    assembler->on_frame(reading(codec, 1, 1.0, 2));
  }
  const MeasurementSet* kept = strict.on_frame(codec.encode_tick(1));
  REQUIRE(kept->packets.size() == 1);
  CHECK(kept->values == std::vector<double>{0.0});
  CHECK(kept->packets[0].first_value == 0);
  CHECK(strict.counters().wrong_counter == 2);
  CHECK(tolerant.on_frame(codec.encode_tick(1))->packets.size() == 3);
}

TEST_CASE("steps go on beyond the width of counter and tick") {
  const FrameCodec codec(small_layout());  // 8 and 16 bits
  MeasurementAssembler assembler(codec, options_of(70000));
  for (std::int64_t step = 1; step <= 70000; ++step) {
    assembler.on_frame(reading(codec, 0, 1.0, step));
    const MeasurementSet* set = assembler.on_frame(codec.encode_tick(step));
    REQUIRE(set != nullptr);
    REQUIRE(set->step == step);
    REQUIRE(set->packets.size() == 1);
  }
  CHECK(assembler.is_finished());
}

TEST_CASE("the owner's clock closes steps where ticks do not") {
  const FrameCodec codec(small_layout());
  AssemblerOptions options = options_of(2);
  options.closed_by_tick = false;
  MeasurementAssembler assembler(codec, options);
  assembler.on_frame(reading(codec, 0, 1.0, 1));
  CHECK(assembler.on_frame(codec.encode_tick(1)) == nullptr);
  CHECK(assembler.counters().odd_ticks == 1);
  const MeasurementSet* set = assembler.close_step();
  REQUIRE(set != nullptr);
  CHECK(set->packets.size() == 1);
  CHECK(assembler.close_step()->packets.empty());
  CHECK(assembler.close_step() == nullptr);
  CHECK(assembler.is_finished());
}

struct GenuineRun {
  std::vector<MeasurementSet> sets;
  AssemblerCounters counters;
};

// Genuine packets of three sensors; before each of them `forge` may put frames of its own.
template <class Forge>
GenuineRun run_with(const FrameCodec& codec, int num_steps, Forge forge) {
  MeasurementAssembler assembler(codec, options_of(num_steps));
  GenuineRun run;
  const auto send = [&](const CanFrame& frame) {
    if (const MeasurementSet* set = assembler.on_frame(frame)) run.sets.push_back(*set);
  };
  for (std::int64_t step = 1; step <= num_steps; ++step) {
    for (int source = 0; source < 3; ++source) {
      forge(step, send);
      // The receive stamp marks what is genuine.
      send(reading(codec, source, static_cast<double>((step + source) % 2), step,
                   1000 * (10 * step + source)));
    }
    forge(step, send);
    send(codec.encode_tick(step));
  }
  run.counters = assembler.counters();
  return run;
}

TEST_CASE("ten forged counters per step move no genuine packet") {
  const FrameCodec codec(small_layout());
  const auto clean = run_with(codec, 20, [](std::int64_t, auto&) {});
  std::mt19937 generator(1);
  int num_forged = 0;
  const auto attacked = run_with(codec, 20, [&](std::int64_t step, auto& send) {
    for (int i = 0; i < 10; ++i) {
      std::int64_t claimed =
          step + 1 + static_cast<std::int64_t>(generator() % 254U);  // never this step mod 256
      send(reading(codec, static_cast<int>(generator() % 3U), 1.0, claimed));
      ++num_forged;
    }
  });
  REQUIRE(clean.sets.size() == 20);
  REQUIRE(attacked.sets.size() == 20);
  CHECK(attacked.counters.wrong_counter == num_forged);
  CHECK(accounted(attacked.counters) == attacked.counters.frames);
  for (std::size_t i = 0; i < 20; ++i) {
    CHECK(attacked.sets[i].values == clean.sets[i].values);
    REQUIRE(attacked.sets[i].packets.size() == 3);
    for (std::size_t j = 0; j < 3; ++j) {
      CHECK(attacked.sets[i].packets[j].receive_utime == clean.sets[i].packets[j].receive_utime);
    }
  }
}

TEST_CASE(
    "forged ticks and odd frames in any order lose and move no genuine packet, and all are "
    "accounted for") {
  const FrameCodec codec(small_layout());
  for (std::uint32_t seed = 1; seed <= 50; ++seed) {
    std::mt19937 generator(seed);
    const auto run = run_with(codec, 30, [&](std::int64_t step, auto& send) {
      for (std::uint32_t left = generator() % 6U; left > 0; --left) {
        CanFrame frame;
        switch (generator() % 5U) {
          case 0:
            frame = codec.encode_tick(step + 1 + static_cast<std::int64_t>(generator() % 60000U));
            break;
          case 1:
            frame = reading(codec, static_cast<int>(generator() % 3U), 1.0, step + 9);
            break;
          case 2:
            frame = reading(codec, static_cast<int>(generator() % 3U), 1.0, step);
            frame.num_bytes = static_cast<std::uint8_t>(generator() % 3U);
            break;
          case 3:
            frame.identifier = generator() % 257U;
            break;
          default:
            frame = reading(codec, static_cast<int>(generator() % 3U), 0.0, step);
            break;  // kept: Z_k is a set of all
        }
        send(frame);
      }
    });
    REQUIRE(run.sets.size() == 30);
    REQUIRE(accounted(run.counters) == run.counters.frames);
    std::int64_t num_packets = 0, last_rx_index = -1;
    for (const MeasurementSet& set : run.sets) {
      std::vector<std::int64_t> genuine;
      for (const Packet& packet : set.packets) {
        REQUIRE(packet.rx_index > last_rx_index);
        last_rx_index = packet.rx_index;
        if (packet.receive_utime != 0) genuine.push_back(packet.receive_utime);
      }
      num_packets += static_cast<std::int64_t>(set.packets.size());
      REQUIRE(set.values.size() == set.packets.size());
      REQUIRE(genuine ==
              std::vector<std::int64_t>{10 * set.step, 10 * set.step + 1, 10 * set.step + 2});
    }
    REQUIRE(num_packets == run.counters.packets);
  }
}

TEST_CASE("NaN is counted and leaves no value behind") {
  const FrameCodec codec(float_layout());
  MeasurementAssembler assembler(codec, options_of(0));
  assembler.on_frame(codec.encode(0, std::vector<double>{1.0, std::nan("")}, 1));
  assembler.on_frame(codec.encode(0, std::vector<double>{1.0, 2.0}, 1));
  const MeasurementSet* set = assembler.on_frame(codec.encode_tick(1));
  CHECK(set->values == std::vector<double>{1.0, 2.0});
  CHECK(assembler.counters().non_finite == 1);
  CHECK(set->packets.at(0).rx_index == 1);
}

}  // namespace
}  // namespace holdfast
