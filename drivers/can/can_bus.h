#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "drivers/can/can_frame.h"

namespace holdfast {

/// What a bus lost or refused; losses are data.
struct BusCounters {
  std::int64_t read = 0;  // data and remote frames handed to the caller
  std::int64_t written = 0;
  std::int64_t kernel_dropped =
      0;                     // receive queue overflow (SO_RXQ_OVFL, or SO_MEMINFO at the end)
  std::int64_t refused = 0;  // malformed on the wire: bad datagram, impossible length, broken line
  std::int64_t write_dropped = 0;  // given up after the write time-out
  std::int64_t error_frames = 0;
  std::int64_t times_down = 0;  // interface went down or away
};

/// One CAN bus, told by its URL. One thread; never blocks but in write(), and there not for longer
/// than the time-out.
class CanBus {
 public:
  virtual ~CanBus() = default;

  /// Descriptor that is readable when read() has frames; -1 for a bus that has none (a file).
  virtual int file_descriptor() const = 0;

  /// Takes what has arrived, in order, up to the span's size; 0 when nothing has. Never returns
  /// frames that this object wrote, nor error frames (counted, and told to the listener).
  virtual std::size_t read(std::span<CanFrame> frames) = 0;

  /// Like read(), but where the bus can, waits for the first frame, up to kReadWait_s: spares a
  /// program that forwards as fast as it can the detour through its loop. Elsewhere: read().
  /// Until it returns 0 or read() is called, file_descriptor() may not tell of frames.
  virtual std::size_t read_waiting(std::span<CanFrame> frames) { return read(frames); }
  static constexpr double kReadWait_s = 0.02;

  /// Like to.write(out) and then read_waiting(frames). Where both buses can, in one system call,
  /// which waits up to twice as long, and not at all when out had to be sent by another one.
  virtual std::size_t hand_over(CanBus& to, std::span<const CanFrame> out,
                                std::span<CanFrame> frames) {
    if (!out.empty()) to.write(out);
    return read_waiting(frames);
  }

  /// Sends in order. A full queue (ENOBUFS, EAGAIN) or an interface that is down is waited for, up
  /// to the time-out, then the frame is dropped and counted. Returns the number sent.
  virtual std::size_t write(std::span<const CanFrame> frames) = 0;

  /// True when no more frames can ever come (end of a file).
  virtual bool at_end() const { return false; }

  /// Counters, brought up to date with the kernel's.
  virtual const BusCounters& counters() = 0;
};

struct BusOptions {
  bool may_write = false;               // read-only unless asked
  std::vector<std::string> owned_urls;  // that the user says to own: allows writing to hardware
  double write_timeout_s = 10.0;
  int receive_buffer_bytes = 8 << 20;
  bool wants_receive_times = true;  // the kernel's stamp on each frame
  bool wants_frames = true;  // false: for writing only; the kernel need not deliver others' frames
  /// Told what happens: "vcan0 is down", "vcan0 is up again", "bus-off". May be empty.
  std::function<void(const std::string&)> on_event;

  bool owns(const std::string& url) const {
    return std::find(owned_urls.begin(), owned_urls.end(), url) != owned_urls.end();
  }
};

/// Opens socketcan:IFACE, udp:GROUP:PORT, slcan:DEVICE (a serial adapter), candump:FILE (read),
/// candump-write:FILE (writes a new one) or loop:NAME. A loop: opened here is alone on its medium;
/// LoopBus objects that share one are made with make_loop_pair() or on a LoopMedium.
///
/// Throws UsageError for a URL that is none of these, or for writing to what is neither vcan,
/// vxcan, loop, a file, nor loopback UDP, unless options.owned_urls has the URL. Throws JobError
/// when the bus cannot be opened.
std::unique_ptr<CanBus> open_can_bus(const std::string& url, const BusOptions& options = {});

/// One spelling for each bus, so that two URLs can be compared: numbers without leading zeros. A
/// URL that names no bus comes back as it is.
std::string canonical_bus_url(const std::string& url);

/// True when this kernel has the interface and it is virtual CAN (vcan or vxcan).
bool is_virtual_can(const std::string& interface_name);

}  // namespace holdfast
