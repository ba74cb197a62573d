// libFuzzer target: a datagram of python-can's udp_multicast format is refused, or holds a valid
// frame that is packed and unpacked as it was; and so is any other frame.

#include "drivers/can/udp_frame.h"

#include <array>
#include <optional>

#include "tests/fuzz/support.h"

namespace holdfast {
namespace {

using fuzzing::must;

void check_frame(const CanFrame& frame) {
  must(is_valid(frame));
  std::array<std::uint8_t, kUdpFrameBytesMax> bytes{};
  const std::size_t size = pack_udp_frame(frame, 1.5, bytes);
  must(size <= bytes.size() && (size == 0) == frame.has(CanFrame::kError));
  if (size == 0) return;
  const std::optional<CanFrame> again = unpack_udp_frame({bytes.data(), size});
  must(again && again->same_on_wire(frame));
  must(!unpack_udp_frame({bytes.data(), size - 1}));
  must(size == bytes.size() || !unpack_udp_frame({bytes.data(), size + 1}));
}

}  // namespace
}  // namespace holdfast

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace holdfast;
  if (const std::optional<CanFrame> frame = unpack_udp_frame({data, size})) check_frame(*frame);
  fuzzing::Input input(data, size);
  check_frame(input.take_frame());
  return 0;
}
