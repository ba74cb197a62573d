#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace holdfast {

/// One CSV file whose columns are fields of a message, measured first and then written.
///
/// Cells go to the file in small pieces and the file is open only meanwhile, so that a thousand
/// tables take neither memory nor file descriptors.
class CsvTable {
 public:
  /// `head`: the columns in front of the fields', separated by commas.
  CsvTable(std::string file, std::string head) : file_(std::move(file)), head_(std::move(head)) {}

  void add_field(std::string name, bool is_array) {
    fields_.push_back({std::move(name), is_array});
  }

  /// First pass: each row's fields in order, with the number of their elements.
  void measure_row() {
    ++num_rows_;
    field_ = 0;
  }
  void measure_field(std::int64_t count);
  std::int64_t num_rows() const { return num_rows_; }

  /// Makes the file, with its header. Throws JobError.
  void begin_writing();

  /// Second pass: the same rows, `head` being the cells of the first columns.
  void begin_row(std::string_view head);
  void begin_field() { next_field(); }
  void put(std::int64_t element, std::string_view cell);
  void end_row();
  /// Text and bytes (in hex) as they are, for files without fields.
  void put_text(std::string_view text);
  void put_hex(std::span<const std::uint8_t> bytes);
  void flush();

  const std::string& file() const { return file_; }
  std::int64_t num_cut() const { return num_cut_; }  // values without a column

 private:
  struct Field {
    std::string name;
    bool is_array = false;
    std::int64_t largest = 0, total = 0;  // elements in one row and in all
    std::int64_t width = 1;               // columns
  };

  std::int64_t width_of(const Field& field) const;
  void next_field();

  std::string file_, head_, buffer_;
  std::vector<Field> fields_;
  std::size_t field_ = 0;     // next
  std::int64_t num_put_ = 0;  // cells of the field before
  std::int64_t num_rows_ = 0, num_cut_ = 0;
  bool is_made_ = false;
};

}  // namespace holdfast
