#include "drivers/can/can_frame.h"

namespace holdfast {
namespace {

constexpr std::uint32_t kStandardIdentifierMax = 0x7FF;
constexpr std::uint32_t kExtendedIdentifierMax = 0x1FFFFFFF;

}  // namespace

bool is_valid(const CanFrame& frame) {
  // The identifier of an error frame is its class, which needs the wide range.
  const bool is_wide = frame.has(CanFrame::kExtended) || frame.has(CanFrame::kError);
  if (frame.identifier > (is_wide ? kExtendedIdentifierMax : kStandardIdentifierMax)) return false;
  if (frame.has(CanFrame::kRemote) && frame.has(CanFrame::kError)) return false;
  if (frame.has(CanFrame::kFd)) {
    if (frame.has(CanFrame::kRemote) || frame.has(CanFrame::kError)) return false;
    return frame.num_bytes <= CanFrame::kBytesMax && fd_length(frame.num_bytes) == frame.num_bytes;
  }
  if (frame.has(CanFrame::kBitRateSwitch) || frame.has(CanFrame::kErrorStateIndicator))
    return false;
  return frame.num_bytes <= 8;
}

std::uint8_t fd_length(std::size_t num_bytes) {
  return *std::lower_bound(kFrameLengths.begin(), kFrameLengths.end(), num_bytes);
}

}  // namespace holdfast
