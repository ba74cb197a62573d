#include "drivers/can/frame_codec.h"

#include <cmath>
#include <limits>

#include "common/errors.h"
#include "tests/support/catch.h"
#include "tests/support/frames.h"
#include "tests/unit/drivers/codec/sensors_layout.h"

namespace holdfast {
namespace {

using FrameKind = FrameCodec::Kind;

using testing::frame_of;

FrameKind kind_of(const FrameCodec& codec, const CanFrame& frame) {
  std::vector<double> values = {7.0};
  const FrameCodec::Decoded decoded = codec.decode(frame, values);
  if (decoded.kind != FrameKind::kReading) CHECK(values == std::vector<double>{7.0});
  return decoded.kind;
}

TEST_CASE("readings and ticks as bytes on the bus") {
  const FrameCodec codec(small_layout());
  CHECK(codec.num_sources() == 3);
  CHECK(codec.encode(0, std::vector<double>{1.0}, 5)
            .same_on_wire(frame_of(257, 0, {0x01, 0x05, 0x00})));
  CHECK(codec.encode(1, std::vector<double>{0.0}, 258)
            .same_on_wire(frame_of(258, 0, {0x00, 0x02, 0x00})));
  CHECK(codec.encode(2, std::vector<double>{1.0}, 255)
            .same_on_wire(frame_of(259, CanFrame::kExtended, {0x80, 0xFF, 0x00})));
  CHECK(codec.encode_tick(0x1234).same_on_wire(frame_of(2032, 0, {0x34, 0x12, 0x00, 0x00})));
  CHECK(codec.tick_identifier() == 2032);
  CHECK(codec.is_tick(codec.encode_tick(1)));
  CHECK_FALSE(codec.is_tick(codec.encode(0, std::vector<double>{1.0}, 1)));

  const FrameCodec floats(float_layout());
  CHECK(floats.encode(0, std::vector<double>{1.0, -1.0}, 9)
            .same_on_wire(frame_of(16, CanFrame::kFd,
                                   {0x00, 0x00, 0x80, 0xBF, 0x3F, 0xF0, 0, 0, 0, 0, 0, 0})));
}

TEST_CASE("a reading is decoded behind the values that are there") {
  const FrameCodec codec(float_layout());
  std::vector<double> values = {5.0};
  const auto decoded = codec.decode(frame_of(16, CanFrame::kFd | CanFrame::kBitRateSwitch,
                                             {0, 0, 0x80, 0xBF, 0x40, 0, 0, 0, 0, 0, 0, 0}),
                                    values);
  REQUIRE(decoded.kind == FrameKind::kReading);
  CHECK(values == std::vector<double>{5.0, 2.0, -1.0});
  CHECK(decoded.packet.source == 0);
  CHECK(decoded.packet.first_value == 1);
  CHECK(decoded.packet.num_values == 2);
  CHECK(decoded.packet.step_counter == -1);
  CHECK(codec.counter_matches(-1, 77));

  const FrameCodec bits(small_layout());
  values.clear();
  const auto third = bits.decode(frame_of(259, CanFrame::kExtended, {0x80, 0xFE, 0x00}), values);
  REQUIRE(third.kind == FrameKind::kReading);
  CHECK(third.packet.source == 2);
  CHECK(third.packet.step_counter == 254);
  CHECK(values == std::vector<double>{1.0});
}

TEST_CASE("what is not of the layout is told apart") {
  const FrameCodec codec(small_layout());
  CHECK(kind_of(codec, frame_of(256, 0, {0, 0, 0})) == FrameKind::kUnknown);
  CHECK(kind_of(codec, frame_of(257, CanFrame::kExtended, {0, 0, 0})) == FrameKind::kUnknown);
  CHECK(kind_of(codec, frame_of(259, 0, {0, 0, 0})) == FrameKind::kUnknown);
  CHECK(kind_of(codec, frame_of(2032, CanFrame::kExtended, {0, 0, 0, 0})) == FrameKind::kUnknown);
  CHECK(kind_of(codec, frame_of(0xFFFFFFFF, 0, {0})) == FrameKind::kUnknown);
  CHECK(kind_of(codec, frame_of(0xFFFFFFFF, CanFrame::kExtended, {0})) == FrameKind::kUnknown);
  CHECK(kind_of(codec, frame_of(257, 0, {0, 0, 0})) == FrameKind::kReading);
  for (std::size_t length : {0U, 1U, 2U, 4U, 5U, 6U, 7U, 8U}) {
    CHECK(kind_of(codec, frame_of(257, 0, std::vector<std::uint8_t>(length))) ==
          FrameKind::kWrongFormat);
  }
  for (std::size_t length : {0U, 1U, 2U, 3U, 5U, 8U}) {
    CHECK(kind_of(codec, frame_of(2032, 0, std::vector<std::uint8_t>(length))) ==
          FrameKind::kWrongFormat);
  }
  CHECK(kind_of(codec, frame_of(2032, 0, std::vector<std::uint8_t>(4))) == FrameKind::kTick);
  CHECK(kind_of(codec, frame_of(257, CanFrame::kFd, {0, 0, 0})) == FrameKind::kWrongFormat);
  CHECK(kind_of(codec, frame_of(257, CanFrame::kFd, std::vector<std::uint8_t>(64))) ==
        FrameKind::kWrongFormat);
  CHECK(kind_of(codec, frame_of(257, CanFrame::kRemote, {0, 0, 0})) == FrameKind::kWrongFormat);
  CHECK(kind_of(codec, frame_of(257, CanFrame::kError, {0, 0, 0})) == FrameKind::kWrongFormat);
  CHECK(kind_of(codec, frame_of(2032, CanFrame::kRemote, {0, 0, 0, 0})) == FrameKind::kWrongFormat);

  const FrameCodec floats(float_layout());
  CHECK(kind_of(floats, frame_of(16, CanFrame::kFd, std::vector<std::uint8_t>(8))) ==
        FrameKind::kWrongFormat);
  CHECK(kind_of(floats, frame_of(16, 0, std::vector<std::uint8_t>(8))) == FrameKind::kWrongFormat);
}

TEST_CASE("NaN and infinity in any signal are refused") {
  const FrameCodec codec(float_layout());
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double bad : {std::nan(""), infinity, -infinity}) {
    CHECK(kind_of(codec, codec.encode(0, std::vector<double>{bad, 1.0}, 1)) ==
          FrameKind::kNonFinite);
    CHECK(kind_of(codec, codec.encode(0, std::vector<double>{1.0, bad}, 1)) ==
          FrameKind::kNonFinite);
  }
  CHECK(kind_of(codec, codec.encode(0, std::vector<double>{1.0, 1e39}, 1)) ==
        FrameKind::kReading);  // saturated
}

TEST_CASE("counters and ticks count modulo their width") {
  const FrameCodec codec(small_layout());
  std::vector<double> values;
  for (const std::int64_t step : {1, 2, 255, 256, 257, 65535, 65536, 1000000}) {
    const auto reading = codec.decode(codec.encode(1, std::vector<double>{1.0}, step), values);
    CHECK(reading.packet.step_counter == step % 256);
    CHECK(codec.counter_matches(reading.packet.step_counter, step));
    CHECK_FALSE(codec.counter_matches(reading.packet.step_counter, step + 1));
    CHECK(codec.counter_matches(reading.packet.step_counter, step + 256));
    const auto tick = codec.decode(codec.encode_tick(step), values);
    CHECK(tick.tick_step == step % 65536);
    CHECK(codec.tick_matches(tick.tick_step, step));
    CHECK_FALSE(codec.tick_matches(tick.tick_step, step - 1));
    CHECK(codec.tick_matches(tick.tick_step, step + 65536));
  }
  CHECK_FALSE(codec.counter_matches(-1, 255));
}

TEST_CASE("what was encoded is decoded, for every source") {
  const FrameCodec codec(small_layout());
  for (int source = 0; source < 3; ++source) {
    for (const double bit : {0.0, 1.0}) {
      std::vector<double> values;
      const auto decoded = codec.decode(codec.encode(source, std::vector<double>{bit}, 41), values);
      CHECK(decoded.kind == FrameKind::kReading);
      CHECK(decoded.packet.source == source);
      CHECK(values == std::vector<double>{bit});
    }
  }
}

TEST_CASE("a multiplexed reading counts only while its signals are selected") {
  FrameLayout layout;
  layout.dbc = parse_dbc(
      "BO_ 1 Mixed: 4 A\n SG_ WHICH M : 0|4@1+ (1,0) [0|0] \"\" M\n SG_ A m3 : 8|8@1+ (1,0) [0|0] "
      "\"\" M\n"
      " SG_ B m0 : 16|8@1+ (1,0) [0|0] \"\" M\n SG_ C m4 : 8|8@1+ (1,0) [0|0] \"\" M\n"
      "BO_ 2032 StepTick: 4 A\n SG_ STEP : 0|32@1+ (1,0) [0|0] \"\" M\nSG_MUL_VAL_ 1 B WHICH "
      "2-3;\n");
  REQUIRE(layout.dbc.problems.empty());
  layout.messages = {"Mixed"};
  layout.signals = {"A", "B"};
  const FrameCodec codec(layout);
  CHECK(codec.encode(0, std::vector<double>{9.0, 8.0}, 1)
            .same_on_wire(frame_of(1, 0, {0x03, 9, 8, 0})));
  CHECK(kind_of(codec, frame_of(1, 0, {0xF3, 9, 8, 0})) == FrameKind::kReading);
  CHECK(kind_of(codec, frame_of(1, 0, {0x02, 9, 8, 0})) == FrameKind::kWrongFormat);
  CHECK(kind_of(codec, frame_of(1, 0, {0x04, 9, 8, 0})) == FrameKind::kWrongFormat);
  layout.signals = {"A", "C"};
  CHECK_THROWS_AS(FrameCodec(layout), UsageError);
}

TEST_CASE("a nested reading counts only while all selectors above it say so") {
  FrameLayout layout;
  layout.dbc = parse_dbc(
      "BO_ 1 Nested: 4 A\n SG_ PAGE M : 0|4@1+ (1,0) [0|0] \"\" M\n"
      " SG_ PART m2M : 4|4@1+ (1,0) [0|0] \"\" M\n SG_ A m5 : 8|8@1+ (1,0) [0|0] \"\" M\n"
      " SG_ B m2 : 16|8@1+ (1,0) [0|0] \"\" M\n SG_ C m3 : 8|8@1+ (1,0) [0|0] \"\" M\n"
      "BO_ 2032 StepTick: 4 A\n SG_ STEP : 0|32@1+ (1,0) [0|0] \"\" M\n"
      "SG_MUL_VAL_ 1 A PART 5-6;\n");
  REQUIRE(layout.dbc.problems.empty());
  layout.messages = {"Nested"};
  layout.signals = {"A", "B"};
  const FrameCodec codec(layout);
  CHECK(codec.encode(0, std::vector<double>{9.0, 8.0}, 1)
            .same_on_wire(frame_of(1, 0, {0x52, 9, 8, 0})));
  CHECK(kind_of(codec, frame_of(1, 0, {0x62, 9, 8, 0})) == FrameKind::kReading);
  CHECK(kind_of(codec, frame_of(1, 0, {0x42, 9, 8, 0})) == FrameKind::kWrongFormat);
  // The inner selector would say so, but is not there itself.
  CHECK(kind_of(codec, frame_of(1, 0, {0x53, 9, 8, 0})) == FrameKind::kWrongFormat);
  layout.signals = {"A", "C"};
  CHECK_THROWS_AS(FrameCodec(layout), UsageError);
}

TEST_CASE("a layout made by hand with names that the DBC lacks is refused") {
  FrameLayout layout = small_layout();
  layout.signals = {"NONE"};
  CHECK_THROWS_AS(FrameCodec(layout), UsageError);
  layout = small_layout();
  layout.tick_message = "NONE";
  CHECK_THROWS_AS(FrameCodec(layout), UsageError);
  layout = small_layout();
  layout.messages.push_back("NONE");
  CHECK_THROWS_AS(FrameCodec(layout), UsageError);
}

}  // namespace
}  // namespace holdfast
