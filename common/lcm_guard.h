#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "common/wire_layout.h"

namespace holdfast {

/// Why a received buffer was refused.
enum class GuardVerdict {
  kOk,
  kTooShort,
  kWrongFingerprint,
  kBadLength,
  kTruncated,
  kTrailingBytes,
  kBadString
};

const char* to_string(GuardVerdict verdict);

/// Checks a received LCM buffer against the layout of its type before the generated code, which
/// trusts every length, may decode it.
///
/// Every array length must be 0 or more and fit into the bytes that are left (in 64 bits), every
/// string must end with its only NUL, and the buffer must end with the last field. What passes
/// decodes, and encodes again to the same bytes.
GuardVerdict check_wire(const TypeLayout& type, std::int64_t fingerprint,
                        std::span<const std::uint8_t> buffer);

}  // namespace holdfast
