#pragma once

#include <fstream>
#include <string>

#include "drivers/can/can_bus.h"

namespace holdfast {

/// Reads the frames of a candump -L log, as fast as they are asked for, of all its interfaces.
///
/// Comment lines are skipped, broken ones counted in `refused`, error frames in `error_frames`.
class CandumpReader : public CanBus {
 public:
  /// Throws UsageError when the file cannot be opened.
  explicit CandumpReader(const std::string& file);

  int file_descriptor() const override { return -1; }
  std::size_t read(std::span<CanFrame> frames) override;
  /// Throws std::logic_error: the log is not written to.
  std::size_t write(std::span<const CanFrame> frames) override;
  bool at_end() const override { return at_end_; }
  const BusCounters& counters() override { return counters_; }

 private:
  std::ifstream stream_;
  std::string line_;
  bool at_end_ = false;
  BusCounters counters_;
};

/// Writes frames into a new candump -L log, as interface "vcan0", so that canplayer plays it there.
///
/// The time of a frame is its receive stamp, or the wall clock for a frame that has none.
class CandumpWriter : public CanBus {
 public:
  /// Throws UsageError when the file exists already, JobError when it cannot be made.
  CandumpWriter(const std::string& file, const BusOptions& options);

  int file_descriptor() const override { return -1; }
  std::size_t read(std::span<CanFrame>) override { return 0; }
  /// Throws JobError when the file cannot take more. Frames that are not valid are dropped,
  /// counted.
  std::size_t write(std::span<const CanFrame> frames) override;
  /// A frame without a stamp is written at time 0 from now on, not with the wall clock's time.
  void keep_times() { keeps_times_ = true; }
  bool at_end() const override { return true; }
  const BusCounters& counters() override { return counters_; }

 private:
  std::string file_;
  bool may_write_, keeps_times_ = false;
  std::ofstream stream_;
  BusCounters counters_;
};

}  // namespace holdfast
