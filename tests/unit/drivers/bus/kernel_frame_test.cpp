#include <linux/can.h>
#include <linux/can/error.h>

#include <cstring>
#include <vector>

#include "drivers/can/socketcan_bus.h"
#include "tests/support/catch.h"

using holdfast::CanFrame;
using holdfast::from_kernel_frame;

namespace {

// Little-endian host: the identifier is written low byte first.
std::vector<std::uint8_t> kernel_bytes(std::uint32_t id, std::uint8_t length, std::uint8_t fd_flags,
                                       std::size_t size) {
  std::vector<std::uint8_t> bytes(size);
  std::memcpy(bytes.data(), &id, 4);
  bytes[4] = length;
  bytes[5] = fd_flags;
  for (std::size_t i = 8; i < size; ++i) bytes[i] = static_cast<std::uint8_t>(i);
  return bytes;
}

}  // namespace

TEST_CASE("kernel frames are told apart by size") {
  const auto classic = from_kernel_frame(kernel_bytes(0x123, 2, 0, 16));
  REQUIRE(classic);
  CHECK(classic->identifier == 0x123);
  CHECK(int{classic->flags} == 0);
  CHECK(int{classic->num_bytes} == 2);
  CHECK(int{classic->data[0]} == 8);
  CHECK(int{classic->data[1]} == 9);
  CHECK(int{classic->data[2]} == 0);

  const auto fd = from_kernel_frame(kernel_bytes(0x80000123, 64, CANFD_BRS | CANFD_ESI | 4, 72));
  REQUIRE(fd);
  CHECK(fd->identifier == 0x123);
  CHECK(int{fd->flags} == (CanFrame::kExtended | CanFrame::kFd | CanFrame::kBitRateSwitch |
                           CanFrame::kErrorStateIndicator));
  CHECK(int{fd->data[63]} == 71);

  for (const std::size_t size : {0, 1, 8, 15, 17, 71, 73}) {
    CHECK_FALSE(from_kernel_frame(kernel_bytes(1, 0, 0, std::max<std::size_t>(size, 8))));
    CHECK_FALSE(from_kernel_frame(std::vector<std::uint8_t>(size)));
  }
}

TEST_CASE("bits above a standard identifier's 11 are cleared") {
  const auto frame = from_kernel_frame(kernel_bytes(0x1800, 0, 0, 16));
  REQUIRE(frame);
  CHECK(frame->identifier == 0);
  CHECK_FALSE(frame->has(CanFrame::kExtended));
}

TEST_CASE("lengths that no bus carries are refused") {
  CHECK_FALSE(from_kernel_frame(kernel_bytes(1, 9, 0, 16)));
  CHECK_FALSE(from_kernel_frame(kernel_bytes(1, 255, 0, 16)));
  CHECK_FALSE(from_kernel_frame(kernel_bytes(1, 10, 0, 72)));
  CHECK_FALSE(from_kernel_frame(kernel_bytes(1, 65, 0, 72)));
  CHECK_FALSE(from_kernel_frame(kernel_bytes(CAN_RTR_FLAG | 1, 0, 0, 72)));
}

TEST_CASE("a remote frame has a length and no data") {
  const auto frame = from_kernel_frame(kernel_bytes(CAN_RTR_FLAG | 0x55, 4, 0, 16));
  REQUIRE(frame);
  CHECK(frame->has(CanFrame::kRemote));
  CHECK(int{frame->num_bytes} == 4);
  CHECK(frame->bytes().empty());
  CHECK(int{frame->data[0]} == 0);
}

TEST_CASE("valid frames come back from the kernel's form as they went in") {
  std::vector<std::uint8_t> bytes(holdfast::kKernelFrameBytesMax);
  int num_checked = 0;
  for (int flags = 0; flags < 64; ++flags) {
    for (int length = 0; length <= 64; ++length) {
      CanFrame frame;
      frame.flags = static_cast<std::uint8_t>(flags);
      frame.identifier = frame.has(CanFrame::kExtended) ? 0x1ABCDE0 : 0x5A5;
      frame.num_bytes = static_cast<std::uint8_t>(length);
      for (std::size_t i = 0; i < frame.bytes().size(); ++i) {
        frame.data[i] = static_cast<std::uint8_t>(i * 3 + 1);
      }
      const std::size_t size = to_kernel_frame(frame, bytes);
      if (!is_valid(frame) || frame.has(CanFrame::kError)) {
        CHECK(size == 0);
        continue;
      }
      CHECK(size == (frame.has(CanFrame::kFd) ? 72U : 16U));
      const auto back = from_kernel_frame(std::span(bytes).first(size));
      REQUIRE(back);
      CHECK(back->same_on_wire(frame));
      ++num_checked;
    }
  }
  // 9 lengths for {standard, extended} x {data, remote}; 16 FD lengths x 2 widths x 4 flag pairs.
  CHECK(num_checked == 9 * 4 + 16 * 2 * 4);
}

TEST_CASE("error frames say what became of the controller") {
  const auto error_frame = [](std::uint32_t error_class, int data1) {
    CanFrame frame;
    frame.flags = CanFrame::kError;
    frame.identifier = error_class;
    frame.num_bytes = 8;
    frame.data[1] = static_cast<std::uint8_t>(data1);
    return frame;
  };
  CHECK(describe_error_frame(error_frame(CAN_ERR_BUSOFF, 0)) == "bus-off");
  CHECK(describe_error_frame(error_frame(CAN_ERR_RESTARTED, 0)) == "restarted");
  CHECK(describe_error_frame(error_frame(CAN_ERR_CRTL, 0x10)) == "error-passive");
  CHECK(describe_error_frame(error_frame(CAN_ERR_CRTL, 0x20)) == "error-passive");
  CHECK(describe_error_frame(error_frame(CAN_ERR_CRTL, 0x08)) == "error-warning");
  CHECK(describe_error_frame(error_frame(CAN_ERR_CRTL, 0x40)) == "error-active again");
  CHECK(describe_error_frame(error_frame(CAN_ERR_BUSERROR | CAN_ERR_PROT, 0)).empty());

  const auto read = from_kernel_frame(kernel_bytes(CAN_ERR_FLAG | CAN_ERR_BUSOFF, 8, 0, 16));
  REQUIRE(read);
  CHECK(read->has(CanFrame::kError));
  CHECK(describe_error_frame(*read) == "bus-off");
}
