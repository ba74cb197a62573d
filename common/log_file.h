#pragma once

#include <cstdint>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "common/lcm_link.h"

namespace holdfast {

/// One event of an LCM log.
struct LogEvent {
  std::int64_t number = 0;
  std::int64_t utime = 0;  // us; the logger's receive stamp, not a time of validity
  std::string channel;
  std::vector<std::uint8_t> data;
};

/// The log that a path names: a run's folder stands for its log.lcm. Throws UsageError for a folder
/// without one.
std::string log_of_run(const std::string& path);

/// Reads LCM logs written by anyone, damaged ones included.
class LogReader {
 public:
  /// Throws UsageError when the file cannot be opened.
  explicit LogReader(const std::string& file);
  /// Next event; false at the end. Damage is skipped up to the next sync word, and counted; after
  /// an event that no other one follows, the search also goes through that event's own bytes, since
  /// a damaged length swallows what stands behind it.
  bool next(LogEvent& event);
  /// Bytes skipped between events.
  std::int64_t damaged_bytes() const { return damaged_bytes_; }
  /// True when the end was reached within an event: its writer died, or still writes.
  bool tail_is_torn() const { return tail_is_torn_; }

 private:
  struct Closer {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  bool finish(std::int64_t event_end, bool looks_like_event);

  std::unique_ptr<std::FILE, Closer> file_;
  std::int64_t size_ = 0;
  std::int64_t last_start_ = -1;     // of the last event
  std::int64_t searched_until_ = 0;  // end of the last event that was searched
  std::int64_t damaged_bytes_ = 0;
  bool tail_is_torn_ = false;
};

/// Writes an LCM log in process: same bytes for the same events, unlike lcm-logger.
class LogWriter {
 public:
  /// From the first event on, or complete only: until finish() it is FILE.part (or .part1, ..,
  /// where that is there), which goes with a writer that ends without. A device is written at once.
  enum class Appears { kAtOnce, kWhenFinished };

  /// Throws JobError when the file cannot be made.
  explicit LogWriter(const std::string& file, Appears appears = Appears::kAtOnce);
  ~LogWriter();
  LogWriter(const LogWriter&) = delete;
  LogWriter& operator=(const LogWriter&) = delete;

  /// Throws JobError when it cannot be written; flush() tells of what the memory still held.
  void write(const std::string& channel, std::int64_t utime, const std::vector<std::uint8_t>& data);
  /// Encodes with the channel's next seq; each producer on a channel has its own.
  template <class Message>
  void write_message(const std::string& channel, std::int64_t utime, Message& message,
                     const std::string& producer = "");
  /// Hands everything to the kernel; throws JobError when the disk is full.
  void flush();
  /// Closes the file and gives it its name, replacing what stood there. Throws JobError.
  void finish();

 private:
  struct Closer {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  std::string name_;
  std::string unfinished_;  // name until then; "": the same
  std::unique_ptr<std::FILE, Closer> file_;
  std::int64_t next_number_ = 0;
  std::map<std::string, std::int64_t> next_seq_;
};

template <class Message>
void LogWriter::write_message(const std::string& channel, std::int64_t utime, Message& message,
                              const std::string& producer) {
  message.seq = next_seq_[producer.empty() ? channel : channel + ' ' + producer]++;
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  write(channel, utime, bytes);
}

}  // namespace holdfast
