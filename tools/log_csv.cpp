#include "tools/log_csv.h"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>

#include "common/errors.h"
#include "common/lcm_guard.h"
#include "common/log_file.h"
#include "common/run_meta.h"
#include "tools/log_csv_table.h"
#include "tools/log_fields.h"
#include "tools/printable_text.h"

namespace holdfast {
namespace {

// Whoever can write to the network can invent channels; no run has as many.
constexpr std::size_t kChannelsMax = 500;  // of our types, and of others

constexpr const char* kEventColumns = "log_event,log_utime";

// A number of a message that stands in front of its lists says which message a list's row is of.
bool is_repeated(const FieldLayout& field) {
  return field.kind == FieldKind::kBytes && !field.is_array;
}

void add_fields(const TypeLayout& type, const std::string& prefix, CsvTable& table) {
  for (std::size_t f = 0; f < type.num_fields; ++f) {
    const FieldLayout& field = type.fields[f];
    if (field.kind != FieldKind::kStruct) {
      table.add_field(prefix + field.name, field.is_array);
    } else if (!field.is_array) {
      add_fields(*field.nested, prefix + field.name + '.', table);
    }
  }
}

struct ListTable {
  const FieldLayout* field;
  CsvTable table;
};

// The tables of one type: one for its messages, and one for each list of structs in it.
struct TypeTables {
  TypeTables(const TypeLayout& type, const std::string& base)
      : messages(base + ".csv", kEventColumns) {
    add_fields(type, "", messages);
    std::string head = kEventColumns;
    for (std::size_t f = 0; f < type.num_fields; ++f) {
      const FieldLayout& field = type.fields[f];
      if (is_repeated(field)) head += std::string(",") + field.name;
      if (field.kind != FieldKind::kStruct || !field.is_array) continue;
      lists.push_back({&field, CsvTable(base + '.' + field.name + ".csv", head + ",element")});
      add_fields(*field.nested, "", lists.back().table);
    }
  }

  CsvTable& table_of(const FieldLayout& field) {
    const auto is_it = [&field](const ListTable& list) { return list.field == &field; };
    return std::ranges::find_if(lists, is_it)->table;
  }

  CsvTable messages;
  std::vector<ListTable> lists;
};

// First pass over a message.
class Measurer {
 public:
  explicit Measurer(TypeTables& tables) : tables_(tables), table_(&tables.messages) {
    table_->measure_row();
  }

  void enter(const FieldLayout& field, std::int64_t) {
    if (!field.is_array) return;
    table_ = &tables_.table_of(field);
    table_->measure_row();
  }
  void leave(const FieldLayout& field) {
    if (field.is_array) table_ = &tables_.messages;
  }
  void begin_field(const FieldLayout&, std::int64_t count) { table_->measure_field(count); }
  void value(const FieldLayout&, std::int64_t, const FieldValue&) {}

 private:
  TypeTables& tables_;
  CsvTable* table_;
};

// Second pass.
class Writer {
 public:
  Writer(TypeTables& tables, const std::string& head)
      : tables_(tables), table_(&tables.messages), head_(head) {
    table_->begin_row(head);
  }

  void enter(const FieldLayout& field, std::int64_t i) {
    is_nested_ = true;
    if (!field.is_array) return;
    table_ = &tables_.table_of(field);
    table_->begin_row(head_ + ',' + std::to_string(i));
  }
  void leave(const FieldLayout& field) {
    is_nested_ = false;
    if (!field.is_array) return;
    table_->end_row();
    table_ = &tables_.messages;
  }
  void begin_field(const FieldLayout&, std::int64_t) { table_->begin_field(); }
  void value(const FieldLayout& field, std::int64_t i, const FieldValue& value) {
    const bool is_text = field.kind == FieldKind::kString;
    const std::string cell = is_text ? csv_text(value.text) : field_text(field, value.bits);
    if (!is_nested_ && is_repeated(field)) head_ += ',' + cell;
    table_->put(i, cell);
  }

 private:
  TypeTables& tables_;
  CsvTable* table_;
  std::string head_;
  bool is_nested_ = false;
};

// The CSV files of one channel. Both passes take the same events.
class ChannelFiles {
 public:
  ChannelFiles(const std::string& channel, const std::string& base)
      : type_(channel_type(channel)),
        raw_(base + ".csv", std::string(kEventColumns) + ",num_bytes,bytes"),
        refused_(base + ".refused.csv", std::string(kEventColumns) + ",verdict,num_bytes,bytes") {
    if (type_.layout != nullptr) tables_.emplace(*type_.layout, base);
  }

  void measure(const LogEvent& event) {
    if (!tables_) {
      raw_.measure_row();
    } else if (verdict_of(event) != GuardVerdict::kOk) {
      refused_.measure_row();
    } else {
      Measurer measurer(*tables_);
      FieldReader(event.data).read(*type_.layout, measurer);
    }
  }

  void write(const LogEvent& event) {
    const std::string head = std::to_string(event.number) + ',' + std::to_string(event.utime);
    if (!tables_) return write_bytes(event, head, raw_);
    const GuardVerdict verdict = verdict_of(event);
    if (verdict != GuardVerdict::kOk)
      return write_bytes(event, head + ',' + to_string(verdict), refused_);
    Writer writer(*tables_, head);
    FieldReader(event.data).read(*type_.layout, writer);
    tables_->messages.end_row();
  }

  // Tables that have rows.
  std::vector<CsvTable*> tables() {
    std::vector<CsvTable*> all = {&raw_};
    if (tables_) {
      all.push_back(&tables_->messages);
      for (ListTable& list : tables_->lists) all.push_back(&list.table);
    }
    all.push_back(&refused_);
    std::erase_if(all, [](const CsvTable* table) { return table->num_rows() == 0; });
    return all;
  }

  std::int64_t num_refused() const { return refused_.num_rows(); }

 private:
  GuardVerdict verdict_of(const LogEvent& event) const {
    return check_wire(*type_.layout, type_.fingerprint, event.data);
  }

  // A leading 0x keeps readers from taking the digits for a number.
  static void write_bytes(const LogEvent& event, const std::string& head, CsvTable& table) {
    table.put_text(head + ',' + std::to_string(event.data.size()) + ",0x");
    table.put_hex(event.data);
    table.put_text("\n");
  }

  ChannelType type_;
  std::optional<TypeTables> tables_;
  CsvTable raw_, refused_;
};

class CsvExporter {
 public:
  CsvExporter(const std::string& log_file, const std::string& folder)
      : log_file_(log_file), folder_(folder) {}

  CsvExport run() {
    for_each_event([this](const LogEvent& event) { measure(event); });
    make_folder();
    for (auto& [name, channel] : channels_) {
      for (CsvTable* table : channel.tables()) {
        table->begin_writing();
        result_.files.push_back(std::filesystem::path(table->file()).filename().string());
      }
    }
    for_each_event([this](const LogEvent& event) {
      const auto found = channels_.find(event.channel);
      if (found != channels_.end()) found->second.write(event);
    });
    for (auto& [name, channel] : channels_) finish(name, channel);
    if (num_left_out_ > 0) {
      result_.notes.push_back(std::to_string(num_left_out_) +
                              " events left out: the log holds more channels than the " +
                              std::to_string(kChannelsMax) + " of each kind that are written");
    }
    return std::move(result_);
  }

 private:
  // Of a log that is still being written, both passes take the same part.
  template <class Function>
  void for_each_event(Function function) {
    LogReader reader(log_file_);
    LogEvent event;
    std::int64_t count = 0;
    while (count < num_events_ && reader.next(event)) {
      function(event);
      ++count;
    }
    num_events_ = count;
  }

  void measure(const LogEvent& event) {
    auto found = channels_.find(event.channel);
    if (found == channels_.end()) {
      std::size_t& count = channel_type(event.channel).layout == nullptr ? num_raw_ : num_typed_;
      if (count == kChannelsMax) {
        ++num_left_out_;
        return;
      }
      ++count;
      const std::string base = folder_ + '/' + file_name_of_channel(event.channel);
      found = channels_.try_emplace(event.channel, event.channel, base).first;
    }
    found->second.measure(event);
  }

  void make_folder() const {
    std::error_code error;
    std::filesystem::create_directories(folder_, error);
    if (error) throw JobError(folder_ + ": cannot be made: " + error.message());
  }

  void finish(const std::string& name, ChannelFiles& channel) {
    std::int64_t num_cut = 0;
    for (CsvTable* table : channel.tables()) {
      table->flush();
      num_cut += table->num_cut();
    }
    const std::string place = printable(name, 60) + ": ";
    if (num_cut > 0) {
      result_.notes.push_back(place + std::to_string(num_cut) +
                              " values left out: their arrays are far longer than the others");
    }
    if (channel.num_refused() > 0) {
      result_.notes.push_back(place + std::to_string(channel.num_refused()) +
                              " events are no messages of ours: their bytes stand in "
                              "the file that ends in .refused.csv");
    }
  }

  const std::string log_file_, folder_;
  std::map<std::string, ChannelFiles> channels_;
  std::size_t num_typed_ = 0, num_raw_ = 0;
  std::int64_t num_events_ = std::numeric_limits<std::int64_t>::max(), num_left_out_ = 0;
  CsvExport result_;
};

}  // namespace

CsvExport write_channel_csv(const std::string& log_file, const std::string& folder) {
  return CsvExporter(log_file, folder).run();
}

std::string csv_text(std::string_view text) {
  std::string cell;
  for (std::size_t start = 0; start <= text.size();) {
    const std::size_t end = std::min(text.find('\n', start), text.size());
    if (start > 0) cell += '\n';
    cell += printable(text.substr(start, end - start), std::string::npos);
    start = end + 1;
  }
  if (!cell.empty() && std::string_view("=+-@").find(cell.front()) != std::string_view::npos) {
    cell.insert(cell.begin(), '\'');
  }
  if (cell.find_first_of(",\"\n") == std::string::npos) return cell;
  std::string quoted = "\"";
  for (const char c : cell) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + '"';
}

std::string file_name_of_channel(std::string_view channel) {
  constexpr std::string_view kDigits = "0123456789ABCDEF";
  constexpr std::size_t kBytesMax = 150;
  std::string name;
  for (const char c : channel) {
    const auto byte = static_cast<std::uint8_t>(c);
    const bool is_kept = (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') ||
                         (c >= 'a' && c <= 'z') || c == '_' || c == '-';
    name += is_kept ? std::string(1, c) : std::string{'%', kDigits[byte >> 4], kDigits[byte & 15U]};
  }
  if (name.size() <= kBytesMax) return name;
  return name.substr(0, kBytesMax) + '~' + scenario_hash(std::string(channel));
}

}  // namespace holdfast
