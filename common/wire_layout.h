#pragma once

#include <cstddef>

namespace holdfast {

struct TypeLayout;

/// What stands in the bytes of one field of an LCM type.
enum class FieldKind {
  kBytes,   // a primitive, or an array of one
  kLength,  // an int32 that may be the length of a later array
  kString,
  kStruct
};

struct FieldLayout {
  const char* name;
  FieldKind kind;
  std::size_t element_bytes;  // of a primitive
  bool is_array;
  int length_field;  // index of the field that holds the array's length, -1 when fixed
  std::size_t fixed_length;
  const TypeLayout* nested;  // of a struct
};

struct TypeLayout {
  const char* name;
  const FieldLayout* fields;
  std::size_t num_fields;
};

}  // namespace holdfast
