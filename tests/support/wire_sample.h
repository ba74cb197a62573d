#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/wire_layout.h"

namespace holdfast::testing {

/// A valid buffer of some type, and where its lengths stand.
struct WireSample {
  std::vector<std::uint8_t> bytes;
  std::vector<std::size_t> array_lengths;   // byte offsets of int32 lengths of arrays
  std::vector<std::size_t> string_lengths;  // byte offsets of int32 lengths of strings

  void put(std::uint64_t value, std::size_t count) {
    for (std::size_t i = count; i-- > 0;)
      bytes.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
  }
  void overwrite_int32(std::size_t offset, std::int32_t value) {
    for (std::size_t i = 0; i < 4; ++i) {
      bytes[offset + i] =
          static_cast<std::uint8_t>(static_cast<std::uint32_t>(value) >> (24 - 8 * i));
    }
  }
};

/// Writes the fields of a type; every array gets num_elements of them.
inline void append_fields(WireSample& sample, const TypeLayout& type, int num_elements) {
  for (std::size_t i = 0; i < type.num_fields; ++i) {
    const FieldLayout& field = type.fields[i];
    if (field.kind == FieldKind::kLength) {
      bool is_length = false;
      for (std::size_t j = i; j < type.num_fields; ++j) {
        is_length = is_length || type.fields[j].length_field == static_cast<int>(i);
      }
      if (is_length) sample.array_lengths.push_back(sample.bytes.size());
      sample.put(is_length ? static_cast<std::uint64_t>(num_elements) : 7, 4);
      continue;
    }
    std::size_t count = 1;
    if (field.is_array) {
      count = field.length_field >= 0 ? static_cast<std::size_t>(num_elements) : field.fixed_length;
    }
    for (std::size_t element = 0; element < count; ++element) {
      if (field.kind == FieldKind::kBytes) {
        sample.put(0x3FF0000000000000U + sample.bytes.size(), field.element_bytes);
      } else if (field.kind == FieldKind::kString) {
        const std::string text = field.name;
        sample.string_lengths.push_back(sample.bytes.size());
        sample.put(text.size() + 1, 4);
        sample.bytes.insert(sample.bytes.end(), text.begin(), text.end());
        sample.bytes.push_back(0);
      } else {
        append_fields(sample, *field.nested, num_elements);
      }
    }
  }
}

inline WireSample wire_sample(const TypeLayout& type, std::int64_t fingerprint, int num_elements) {
  WireSample sample;
  sample.put(static_cast<std::uint64_t>(fingerprint), 8);
  append_fields(sample, type, num_elements);
  return sample;
}

}  // namespace holdfast::testing
