#include "drivers/can/candump_bus.h"

#include <filesystem>
#include <stdexcept>

#include "common/clock.h"
#include "common/errors.h"
#include "drivers/can/candump_log.h"

namespace holdfast {

CandumpReader::CandumpReader(const std::string& file) : stream_(file) {
  // A folder opens without complaint, and only its first read fails.
  if (!stream_ || std::filesystem::is_directory(file)) {
    throw UsageError(file + ": cannot be read as a candump log");
  }
}

std::size_t CandumpReader::read(std::span<CanFrame> frames) {
  std::size_t num_read = 0;
  CandumpRecord record;
  while (num_read < frames.size() && !at_end_) {
    if (!std::getline(stream_, line_)) {
      at_end_ = true;
      break;
    }
    const CandumpLine kind = parse_candump_line(line_, record);
    if (kind == CandumpLine::kBroken) {
      ++counters_.refused;
    } else if (kind == CandumpLine::kFrame && record.frame.has(CanFrame::kError)) {
      ++counters_.error_frames;
    } else if (kind == CandumpLine::kFrame) {
      frames[num_read++] = record.frame;
    }
  }
  counters_.read += static_cast<std::int64_t>(num_read);
  return num_read;
}

std::size_t CandumpReader::write(std::span<const CanFrame>) {
  throw std::logic_error("a candump log that is read is not written to");
}

CandumpWriter::CandumpWriter(const std::string& file, const BusOptions& options)
    : file_(file), may_write_(options.may_write) {
  if (std::filesystem::exists(file)) {
    throw UsageError(file + ": exists already; remove it or name another file");
  }
  stream_.open(file);
  if (!stream_) throw JobError(file + ": cannot be made");
}

std::size_t CandumpWriter::write(std::span<const CanFrame> frames) {
  if (!may_write_) throw std::logic_error("the bus was opened read-only");
  std::size_t num_written = 0;
  CandumpRecord record;
  record.interface_name = "vcan0";
  for (const CanFrame& frame : frames) {
    if (!is_valid(frame) || frame.has(CanFrame::kError)) {
      ++counters_.write_dropped;
      continue;
    }
    record.frame = frame;
    record.time_ns =
        frame.receive_time_ns > 0 || keeps_times_ ? frame.receive_time_ns : wall_utime() * 1000;
    stream_ << format_candump_line(record) << '\n';
    ++num_written;
  }
  stream_.flush();
  if (!stream_) throw JobError(file_ + ": cannot be written, is the disk full?");
  counters_.written += static_cast<std::int64_t>(num_written);
  return num_written;
}

}  // namespace holdfast
