#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "common/wire_layout.h"

namespace holdfast {

/// The type that a channel carries by its name.
struct ChannelType {
  const TypeLayout* layout = nullptr;  // null: none of our channels
  std::int64_t fingerprint = 0;
  bool is_once_per_step = false;
};

ChannelType channel_type(std::string_view channel);

/// True for the 8-byte fields of lcmtypes/ that hold integers; all others hold doubles.
bool is_integer_field(std::string_view name);

/// One value in a message.
struct FieldValue {
  std::uint64_t bits = 0;  // of a number, as on the wire
  std::string_view text;   // of a string
};

/// A number as text: integers in full, doubles with 17 digits ("nan", "inf", "-inf").
std::string field_text(const FieldLayout& field, std::uint64_t bits);

/// Bytes of a message on the wire in front of its fields.
inline constexpr std::size_t kFingerprintBytes = 8;

/// Reads the fields of a message that passed the guard, by its layout, in the order of the wire.
///
/// The visitor gets begin_field(field, count) and value(field, index, value) for each field of
/// numbers or strings, and enter(field, index) and leave(field) around each nested struct. Nothing
/// is copied, so a message of any size takes no memory. Precondition: check_wire said kOk.
class FieldReader {
 public:
  /// `message` with its fingerprint.
  explicit FieldReader(std::span<const std::uint8_t> message)
      : bytes_(message.subspan(kFingerprintBytes)) {}

  template <class Visitor>
  void read(const TypeLayout& type, Visitor& visitor) {
    std::int64_t lengths[kFieldsMax] = {};
    for (std::size_t f = 0; f < type.num_fields && f < kFieldsMax; ++f) {
      const FieldLayout& field = type.fields[f];
      std::int64_t count = 1;
      if (field.is_array) {
        count = field.length_field >= 0 ? lengths[field.length_field]
                                        : static_cast<std::int64_t>(field.fixed_length);
      }
      if (field.kind == FieldKind::kStruct) {
        for (std::int64_t i = 0; i < count; ++i) {
          visitor.enter(field, i);
          read(*field.nested, visitor);
          visitor.leave(field);
        }
        continue;
      }
      visitor.begin_field(field, count);
      for (std::int64_t i = 0; i < count; ++i) {
        const FieldValue value = take(field);
        if (field.kind == FieldKind::kLength) lengths[f] = static_cast<std::int32_t>(value.bits);
        visitor.value(field, i, value);
      }
    }
  }

 private:
  static constexpr std::size_t kFieldsMax = 64;  // more than any type has

  FieldValue take(const FieldLayout& field);
  std::uint64_t take_number(std::size_t count);

  std::span<const std::uint8_t> bytes_;
};

}  // namespace holdfast
