#include "drivers/measurement_assembler.h"
#include "drivers/radio_channel.h"
#include "tests/support/allocation_count.h"
#include "tests/support/catch.h"
#include "tests/unit/drivers/codec/sensors_layout.h"

namespace holdfast {
namespace {

TEST_CASE("encoding, decoding, assembling and the radio allocate nothing once warm") {
  const FrameCodec codec(small_layout());
  MeasurementAssembler assembler(codec, {});
  RadioChannel radio(2.0, 0.5, 1, 0);
  MeasurementSet heard;
  double sum = 0.0;
  const auto run_step = [&](std::int64_t step) {
    const double bit = 1.0;
    for (int source = 0; source < 3; ++source) {
      for (int copy = 0; copy < 3; ++copy)
        assembler.on_frame(codec.encode(source, {&bit, 1}, step));
      assembler.on_frame(codec.encode(source, {&bit, 1}, step + 1));  // refused
    }
    heard = *assembler.on_frame(codec.encode_tick(step));
    radio.apply(heard);
    sum += heard.values.front();
  };
  run_step(1);
  run_step(2);  // the second of the two sets
  run_step(3);
  const std::int64_t before = testing::allocation_count();
  for (std::int64_t step = 4; step < 200; ++step) run_step(step);
  CHECK(testing::allocation_count() == before);
  CHECK(sum != 0.0);
  // Negative control: the counter sees allocations.
  const std::vector<double> some(10);
  CHECK(testing::allocation_count() > before);
}

}  // namespace
}  // namespace holdfast
