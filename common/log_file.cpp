#include "common/log_file.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "common/errors.h"

namespace holdfast {
namespace {

constexpr int kPartNamesMax = 1000;

// LCM log format: sync word, event number, time stamp, channel length, data length, then both,
// big-endian without padding.
constexpr std::array<std::uint8_t, 4> kSyncBytes{0xED, 0xA1, 0xDA, 0x01};
constexpr std::size_t kHeaderBytes = 28;
constexpr std::uint32_t kLoggedChannelBytesMax = 999;

std::uint64_t big_endian(const std::uint8_t* bytes, std::size_t count) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < count; ++i) value = (value << 8) | bytes[i];
  return value;
}

void put_big_endian(std::uint8_t* bytes, std::uint64_t value, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i)
    bytes[i] = static_cast<std::uint8_t>(value >> (8 * (count - 1 - i)));
}

}  // namespace

LogReader::LogReader(const std::string& file) : file_(std::fopen(file.c_str(), "rb")) {
  if (!file_) throw UsageError(file + ": cannot be read: " + std::strerror(errno));
  if (std::fseek(file_.get(), 0, SEEK_END) != 0) throw UsageError(file + ": is no log file");
  size_ = std::ftell(file_.get());
  std::rewind(file_.get());
}

bool LogReader::finish(std::int64_t event_end, bool looks_like_event) {
  const std::int64_t left = size_ - event_end;
  if (looks_like_event) {
    tail_is_torn_ = true;
  } else {
    damaged_bytes_ += left;
  }
  std::fseek(file_.get(), 0, SEEK_END);
  return false;
}

bool LogReader::next(LogEvent& event) {
  const std::int64_t event_end = std::ftell(file_.get());
  bool looks_like_event = false;  // what stands right after the last event, as far as it goes
  bool goes_back = false;
  for (std::int64_t start = event_end;;) {
    std::array<std::uint8_t, kHeaderBytes> header{};
    const std::size_t got = std::fread(header.data(), 1, kHeaderBytes, file_.get());
    if (got == 0 && start == event_end && !goes_back) return false;
    const bool is_synchronised = std::equal(
        header.begin(), header.begin() + std::min<std::size_t>(got, 4), kSyncBytes.begin());
    const std::uint64_t channel_bytes = big_endian(&header[20], 4);
    const std::uint64_t data_bytes = big_endian(&header[24], 4);
    const bool is_event =
        is_synchronised && channel_bytes >= 1 && channel_bytes <= kLoggedChannelBytesMax;
    if (start == event_end && !goes_back) {
      looks_like_event = got < kHeaderBytes ? is_synchronised : is_event;
      // No event follows the last one, so its length may be wrong and others may stand in it. Once
      // for the same bytes: a file can hold events within events.
      if (!is_synchronised && last_start_ >= searched_until_) {
        goes_back = true;
        searched_until_ = event_end;
        start = last_start_ + 1;
        std::fseek(file_.get(), static_cast<long>(start), SEEK_SET);
        continue;
      }
    }
    if (got < kHeaderBytes) return finish(event_end, looks_like_event);
    const auto left = static_cast<std::uint64_t>(size_ - start) - kHeaderBytes;
    if (is_event && channel_bytes + data_bytes <= left) {
      event.number = static_cast<std::int64_t>(big_endian(&header[4], 8));
      event.utime = static_cast<std::int64_t>(big_endian(&header[12], 8));
      event.channel.resize(channel_bytes);
      event.data.resize(data_bytes);
      if (std::fread(event.channel.data(), 1, channel_bytes, file_.get()) != channel_bytes ||
          std::fread(event.data.data(), 1, data_bytes, file_.get()) != data_bytes) {
        return finish(event_end, looks_like_event);
      }
      damaged_bytes_ += start - (start < event_end ? last_start_ : event_end);
      last_start_ = start;
      return true;
    }
    // The next sync word can only begin where its first byte stands.
    start += std::find(header.begin() + 1, header.end(), kSyncBytes[0]) - header.begin();
    std::fseek(file_.get(), static_cast<long>(start), SEEK_SET);
  }
}

std::string log_of_run(const std::string& path) {
  if (!std::filesystem::is_directory(path)) return path;
  const std::filesystem::path log = std::filesystem::path(path) / "log.lcm";
  if (std::filesystem::exists(log)) return log.string();
  throw UsageError(path + ": a folder without log.lcm; name a log, or a run's folder");
}

LogWriter::LogWriter(const std::string& file, Appears appears) : name_(file) {
  // What is no file, as a device, cannot be replaced by one.
  std::error_code error;
  const bool is_file =
      !std::filesystem::exists(file, error) || std::filesystem::is_regular_file(file, error);
  if (appears == Appears::kAtOnce || !is_file) {
    file_.reset(std::fopen(file.c_str(), "wb"));
  } else {
    // A file with that name may be anybody's, or what is left of a writer that was killed.
    for (int i = 0; !file_ && i < kPartNamesMax; ++i) {
      unfinished_ = file + ".part" + (i == 0 ? "" : std::to_string(i));
      file_.reset(std::fopen(unfinished_.c_str(), "wbx"));
      if (!file_ && errno != EEXIST) break;
    }
  }
  if (!file_) throw JobError(name_ + ": cannot be written: " + std::strerror(errno));
}

LogWriter::~LogWriter() {
  if (file_ && !unfinished_.empty()) std::remove(unfinished_.c_str());
}

void LogWriter::write(const std::string& channel, std::int64_t utime,
                      const std::vector<std::uint8_t>& data) {
  std::array<std::uint8_t, kHeaderBytes> header;
  std::copy(kSyncBytes.begin(), kSyncBytes.end(), header.begin());
  put_big_endian(&header[4], static_cast<std::uint64_t>(next_number_++), 8);
  put_big_endian(&header[12], static_cast<std::uint64_t>(utime), 8);
  put_big_endian(&header[20], channel.size(), 4);
  put_big_endian(&header[24], data.size(), 4);
  const bool written =
      std::fwrite(header.data(), 1, kHeaderBytes, file_.get()) == kHeaderBytes &&
      std::fwrite(channel.data(), 1, channel.size(), file_.get()) == channel.size() &&
      // An empty vector has no address to pass on.
      (data.empty() || std::fwrite(data.data(), 1, data.size(), file_.get()) == data.size());
  if (!written) throw JobError(name_ + ": cannot be written: " + std::strerror(errno));
}

void LogWriter::finish() {
  flush();
  if (!unfinished_.empty() && std::rename(unfinished_.c_str(), name_.c_str()) != 0) {
    throw JobError(name_ + ": cannot be written: " + std::strerror(errno));
  }
  file_.reset();
}

void LogWriter::flush() {
  if (std::fflush(file_.get()) != 0) {
    throw JobError(name_ + ": cannot be written: " + std::strerror(errno));
  }
}

}  // namespace holdfast
