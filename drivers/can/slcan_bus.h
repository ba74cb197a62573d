#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "drivers/can/can_bus.h"
#include "drivers/can/slcan_line.h"
#include "drivers/file_descriptor.h"

namespace holdfast {

/// slcan:DEVICE[@BAUD][?bitrate=N][&fd_bitrate=N]: which adapter, and how it is set up.
struct SlcanUrl {
  std::string device;
  int baud = 115200;      // of the serial line; meaningless for adapters on USB
  int bitrate = 500'000;  // of the bus
  int fd_bitrate = 0;     // of the data phase, 2 or 5 million; 0: the adapter is not told

  /// Throws UsageError, which says what may stand there.
  static SlcanUrl parse(const std::string& url);
};

/// A CAN bus behind a serial adapter that speaks SLCAN (Lawicel), host side.
///
/// Works with adapters that answer and with those that do not. One that is pulled out is waited
/// for, said through on_event, and set up again when its device is back; the descriptor stays the
/// same through this. A bus that is only read is opened listen-only, where the adapter can be.
/// Receive times are the host's.
class SlcanBus : public CanBus {
 public:
  /// Throws UsageError for a wrong URL and for writing to an adapter that options.owned_urls does
  /// not name, JobError when the device cannot be opened.
  SlcanBus(const std::string& url, const BusOptions& options);

  int file_descriptor() const override { return wake_.get(); }
  std::size_t read(std::span<CanFrame> frames) override;
  /// Throws std::logic_error when the bus was opened read-only. What the adapter refuses afterwards
  /// (it answers with a bell) counts as dropped then.
  std::size_t write(std::span<const CanFrame> frames) override;
  const BusCounters& counters() override { return counters_; }

 private:
  void watch(int descriptor);
  void set_timer(std::int64_t first_ns, std::int64_t period_ns);
  bool open_device();
  void close_device(const std::string& why);
  void try_again();
  void read_device();
  void on_line(SlcanLine kind, const CanFrame& frame, std::string_view line);
  void on_answer(std::string_view line, bool is_refused);
  void on_opening_refused();
  void on_bus_state(std::string_view line);
  // Sends what it can until the deadline; returns how many bytes that were.
  std::size_t send(std::string_view text, std::int64_t deadline_ns);
  void tell(const std::string& text) const;

  SlcanUrl url_;
  BusOptions options_;
  FileDescriptor wake_;   // epoll over the device and the timer
  FileDescriptor timer_;  // runs while the device is away, or frames wait to be read
  FileDescriptor device_;
  SlcanReader reader_;
  std::vector<CanFrame> received_;
  std::size_t next_ = 0;    // of received_, to be read
  bool is_waking_ = false;  // the timer says that frames wait, which the device does not any more
  std::string sending_;
  bool is_line_cut_ = false;  // the last line went out in part
  // What was asked and not answered yet: commands of the set-up, then frames.
  std::int64_t unanswered_set_up_ = 0, unanswered_ = 0;
  bool is_opened_to_listen_ = false;
  bool has_refused_ = false;  // told of
  char bus_state_ = 'a';
  BusCounters counters_;
};

}  // namespace holdfast
