#include "drivers/can/can_messages.h"

#include <holdfast/can_frame_t.hpp>

#include "tests/support/catch.h"

using holdfast::can_frame_t;
using holdfast::CanFrame;

TEST_CASE("frames come back from their message") {
  for (const int flags : {0, int{CanFrame::kExtended}, int{CanFrame::kRemote},
                          CanFrame::kFd | CanFrame::kBitRateSwitch, int{CanFrame::kError}}) {
    CanFrame frame;
    frame.identifier = 0x345;
    frame.flags = static_cast<std::uint8_t>(flags);
    frame.num_bytes = 8;
    for (std::size_t i = 0; i < frame.bytes().size(); ++i) {
      frame.data[i] = static_cast<std::uint8_t>(200 + i);
    }
    frame.receive_time_ns = 1'234'567'890;
    can_frame_t message;
    to_message(frame, 17, message);
    CHECK(message.index == 17);
    CHECK(message.receive_utime == 1'234'567);
    CHECK(message.data.size() == 8);
    CanFrame back;
    REQUIRE(from_message(message, back));
    CHECK(back.same_on_wire(frame));
    CHECK(back.receive_time_ns == 1'234'567'000);
  }
}

TEST_CASE("messages that hold no frame are refused") {
  CanFrame frame;
  can_frame_t good;
  to_message(frame, 0, good);
  REQUIRE(from_message(good, frame));
  const auto refused = [&](auto change) {
    can_frame_t message = good;
    change(message);
    return !from_message(message, frame);
  };
  CHECK(refused([](can_frame_t& m) { m.identifier = -1; }));
  CHECK(refused([](can_frame_t& m) { m.identifier = 0x800; }));
  CHECK(refused([](can_frame_t& m) { m.flags = 64; }));
  CHECK(refused([](can_frame_t& m) { m.flags = -1; }));
  CHECK(refused([](can_frame_t& m) { m.num_bytes = 65, m.data.resize(65); }));
  CHECK(refused([](can_frame_t& m) { m.num_bytes = 9, m.data.resize(9); }));
  CHECK(refused([](can_frame_t& m) { m.num_bytes = 4; }));
}
