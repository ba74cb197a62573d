#include "drivers/can/can_frame.h"

#include "tests/support/catch.h"

using holdfast::CanFrame;

namespace {

CanFrame frame_of(std::uint32_t identifier, int flags, int num_bytes) {
  CanFrame frame;
  frame.identifier = identifier;
  frame.flags = static_cast<std::uint8_t>(flags);
  frame.num_bytes = static_cast<std::uint8_t>(num_bytes);
  return frame;
}

}  // namespace

TEST_CASE("fd_length is the smallest length of ISO 11898-1 that holds the bytes") {
  const int lengths[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
  for (std::size_t num_bytes = 0; num_bytes <= 64; ++num_bytes) {
    int expected = -1;
    for (const int length : lengths) {
      if (length >= static_cast<int>(num_bytes)) {
        expected = length;
        break;
      }
    }
    CHECK(int{holdfast::fd_length(num_bytes)} == expected);
  }
}

TEST_CASE("a frame is valid when a bus can carry it") {
  CHECK(is_valid(frame_of(0x7FF, 0, 8)));
  CHECK_FALSE(is_valid(frame_of(0x800, 0, 8)));
  CHECK(is_valid(frame_of(0x1FFFFFFF, CanFrame::kExtended, 0)));
  CHECK_FALSE(is_valid(frame_of(0x20000000, CanFrame::kExtended, 0)));
  CHECK_FALSE(is_valid(frame_of(1, 0, 9)));
  CHECK_FALSE(is_valid(frame_of(1, CanFrame::kFd, 9)));
  CHECK_FALSE(is_valid(frame_of(1, CanFrame::kFd, 65)));
  CHECK(is_valid(frame_of(1, CanFrame::kFd, 64)));
  CHECK(is_valid(frame_of(1, CanFrame::kFd | CanFrame::kBitRateSwitch, 12)));
  CHECK_FALSE(is_valid(frame_of(1, CanFrame::kBitRateSwitch, 8)));
  CHECK_FALSE(is_valid(frame_of(1, CanFrame::kErrorStateIndicator, 8)));
  CHECK(is_valid(frame_of(1, CanFrame::kRemote, 8)));
  CHECK_FALSE(is_valid(frame_of(1, CanFrame::kRemote | CanFrame::kFd, 8)));
  CHECK(is_valid(frame_of(0x1FFFFFFF, CanFrame::kError, 8)));
  CHECK_FALSE(is_valid(frame_of(1, CanFrame::kError | CanFrame::kRemote, 8)));
}

TEST_CASE("what stands behind the length of a frame does not count") {
  CanFrame one = frame_of(1, 0, 2), other = one;
  other.data[2] = 7;
  other.receive_time_ns = 5;
  CHECK(one.same_on_wire(other));
  other.data[1] = 7;
  CHECK_FALSE(one.same_on_wire(other));
}
