#include "common/lcm_guard.h"

#include <algorithm>
#include <array>

namespace holdfast {
namespace {

constexpr std::size_t kFieldsMax = 32;

class Walker {
 public:
  explicit Walker(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  std::size_t left() const { return bytes_.size() - position_; }

  bool skip(std::uint64_t count) {
    if (count > left()) return false;
    position_ += static_cast<std::size_t>(count);
    return true;
  }

  bool read_int32(std::int32_t& value) {
    if (left() < 4) return false;
    std::uint32_t word = 0;
    for (int i = 0; i < 4; ++i)
      word = (word << 8) | bytes_[position_ + static_cast<std::size_t>(i)];
    value = static_cast<std::int32_t>(word);
    position_ += 4;
    return true;
  }

  GuardVerdict string() {
    std::int32_t length = 0;
    if (!read_int32(length)) return GuardVerdict::kTruncated;
    if (length < 1 || static_cast<std::uint64_t>(length) > left()) return GuardVerdict::kBadString;
    // The one NUL is the last byte: a C reader and a C++ reader then see the same text.
    const auto text = bytes_.subspan(position_, static_cast<std::size_t>(length));
    if (std::find(text.begin(), text.end(), 0) != text.end() - 1) return GuardVerdict::kBadString;
    skip(static_cast<std::uint64_t>(length));
    return GuardVerdict::kOk;
  }

  GuardVerdict structure(const TypeLayout& type) {
    std::array<std::int32_t, kFieldsMax> lengths{};
    if (type.num_fields > kFieldsMax) return GuardVerdict::kBadLength;
    for (std::size_t i = 0; i < type.num_fields; ++i) {
      const GuardVerdict verdict = field(type.fields[i], lengths, i);
      if (verdict != GuardVerdict::kOk) return verdict;
    }
    return GuardVerdict::kOk;
  }

 private:
  GuardVerdict field(const FieldLayout& layout, std::array<std::int32_t, kFieldsMax>& lengths,
                     std::size_t index) {
    if (layout.kind == FieldKind::kLength) {
      return read_int32(lengths[index]) ? GuardVerdict::kOk : GuardVerdict::kTruncated;
    }
    std::uint64_t count = layout.is_array ? layout.fixed_length : 1;
    if (layout.is_array && layout.length_field >= 0) {
      const std::int32_t length = lengths[static_cast<std::size_t>(layout.length_field)];
      // Each element takes a byte at least, so this also bounds the loop below.
      if (length < 0 || static_cast<std::uint64_t>(length) > left())
        return GuardVerdict::kBadLength;
      count = static_cast<std::uint64_t>(length);
    }
    if (layout.kind == FieldKind::kBytes) {
      if (count * layout.element_bytes > left()) {
        return layout.is_array ? GuardVerdict::kBadLength : GuardVerdict::kTruncated;
      }
      skip(count * layout.element_bytes);
      return GuardVerdict::kOk;
    }
    for (std::uint64_t element = 0; element < count; ++element) {
      const GuardVerdict verdict =
          layout.kind == FieldKind::kString ? string() : structure(*layout.nested);
      if (verdict != GuardVerdict::kOk) return verdict;
    }
    return GuardVerdict::kOk;
  }

  std::span<const std::uint8_t> bytes_;
  std::size_t position_ = 0;
};

}  // namespace

const char* to_string(GuardVerdict verdict) {
  switch (verdict) {
    case GuardVerdict::kOk:
      return "ok";
    case GuardVerdict::kTooShort:
      return "too_short";
    case GuardVerdict::kWrongFingerprint:
      return "wrong_fingerprint";
    case GuardVerdict::kBadLength:
      return "bad_length";
    case GuardVerdict::kTruncated:
      return "truncated";
    case GuardVerdict::kTrailingBytes:
      return "trailing_bytes";
    case GuardVerdict::kBadString:
      return "bad_string";
  }
  return "unknown";
}

GuardVerdict check_wire(const TypeLayout& type, std::int64_t fingerprint,
                        std::span<const std::uint8_t> buffer) {
  if (buffer.size() < 8) return GuardVerdict::kTooShort;
  std::uint64_t word = 0;
  for (std::size_t i = 0; i < 8; ++i) word = (word << 8) | buffer[i];
  if (word != static_cast<std::uint64_t>(fingerprint)) return GuardVerdict::kWrongFingerprint;
  Walker walker(buffer.subspan(8));
  const GuardVerdict verdict = walker.structure(type);
  if (verdict != GuardVerdict::kOk) return verdict;
  return walker.left() == 0 ? GuardVerdict::kOk : GuardVerdict::kTrailingBytes;
}

}  // namespace holdfast
