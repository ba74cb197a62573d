#include "tools/log_csv_table.h"

#include <algorithm>
#include <fstream>

#include "common/errors.h"

namespace holdfast {
namespace {

constexpr std::size_t kBufferBytes = 1 << 14;
constexpr std::int64_t kColumnsMax = 16384;  // of one array; as many as a spreadsheet takes
// One long array among many short ones would fill the file with empty cells: cells of an array's
// columns may be this many times its values, and this many more.
constexpr std::int64_t kCellsPerValue = 4, kSpareCells = 200'000;

}  // namespace

void CsvTable::measure_field(std::int64_t count) {
  Field& field = fields_[field_++];
  field.largest = std::max(field.largest, count);
  field.total += count;
}

std::int64_t CsvTable::width_of(const Field& field) const {
  if (!field.is_array) return 1;
  const std::int64_t affordable =
      (kCellsPerValue * field.total + kSpareCells) / std::max<std::int64_t>(num_rows_, 1);
  return std::min({field.largest, affordable, kColumnsMax});
}

void CsvTable::begin_writing() {
  put_text(head_);
  for (Field& field : fields_) {
    field.width = width_of(field);
    for (std::int64_t i = 0; i < field.width; ++i) {
      put_text(',' + field.name + (field.is_array ? '[' + std::to_string(i) + ']' : ""));
    }
  }
  put_text("\n");
  flush();
}

void CsvTable::begin_row(std::string_view head) {
  put_text(head);
  field_ = 0;
  num_put_ = 0;
}

// A field with fewer elements than columns leaves the others empty.
void CsvTable::next_field() {
  if (field_ > 0) {
    for (; num_put_ < fields_[field_ - 1].width; ++num_put_) put_text(",");
  }
  ++field_;
  num_put_ = 0;
}

void CsvTable::put(std::int64_t element, std::string_view cell) {
  if (element >= fields_[field_ - 1].width) {
    ++num_cut_;
    return;
  }
  put_text(",");
  put_text(cell);
  ++num_put_;
}

void CsvTable::end_row() {
  next_field();
  put_text("\n");
}

void CsvTable::put_text(std::string_view text) {
  buffer_ += text;
  if (buffer_.size() > kBufferBytes) flush();
}

void CsvTable::put_hex(std::span<const std::uint8_t> bytes) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  for (const std::uint8_t byte : bytes) {
    const char pair[] = {kDigits[byte >> 4], kDigits[byte & 15U]};
    put_text({pair, 2});
  }
}

void CsvTable::flush() {
  if (buffer_.empty()) return;
  std::ofstream stream(file_, is_made_ ? std::ios::app | std::ios::binary : std::ios::binary);
  stream << buffer_;
  if (!stream.flush()) throw JobError(file_ + ": cannot be written");
  is_made_ = true;
  buffer_.clear();
}

}  // namespace holdfast
