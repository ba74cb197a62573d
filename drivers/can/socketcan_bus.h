#pragma once

#include <memory>
#include <optional>
#include <string>

#include "drivers/can/can_bus.h"
#include "drivers/can/datagram_batch.h"
#include "drivers/can/network_link.h"
#include "drivers/file_descriptor.h"

namespace holdfast {

class RingExchange;

/// Bytes of the kernel's struct canfd_frame; a classic struct can_frame has 16.
inline constexpr std::size_t kKernelFrameBytesMax = 72;

/// Reads what the kernel delivers: 16 bytes are a classic frame, 72 one of CAN FD.
///
/// Identifier bits that the frame's width does not have are cleared. No value for another size and
/// for what no bus can carry (classic length above 8, FD remote frame, impossible FD length).
std::optional<CanFrame> from_kernel_frame(std::span<const std::uint8_t> bytes);

/// Writes the kernel's form; returns 16 or 72, or 0 for a frame that is not valid or an error
/// frame. Precondition: bytes.size() >= kKernelFrameBytesMax.
std::size_t to_kernel_frame(const CanFrame& frame, std::span<std::uint8_t> bytes);

/// What an error frame says of the controller's state: "bus-off", "restarted", "error-passive",
/// "error-warning", "error-active again", "receive overflow", ...; "" for what only counts
/// (bus errors, which may come by the thousand).
std::string describe_error_frame(const CanFrame& frame);

/// A kernel CAN interface by one raw socket for both directions, so that it never hears itself.
///
/// An interface that goes down or away is waited for and said through on_event; one that was made
/// anew under the same name is bound again. The descriptor stays the same through all of this.
class SocketCanBus : public CanBus {
 public:
  /// Opens the interface. Throws JobError when the kernel has no CAN or no such interface,
  /// UsageError for writing to hardware that options.owned_urls does not name.
  SocketCanBus(const std::string& interface_name, const BusOptions& options);

  /// Takes an open socket that carries the kernel's frames as datagrams (a socketpair, in tests).
  SocketCanBus(FileDescriptor open_socket, const std::string& name, const BusOptions& options);

  ~SocketCanBus() override;

  int file_descriptor() const override { return wake_.get(); }
  std::size_t read(std::span<CanFrame> frames) override { return read_frames(frames, false); }
  std::size_t read_waiting(std::span<CanFrame> frames) override {
    return read_frames(frames, true);
  }
  /// In one call where frames come one by one, to another SocketCAN bus, without receive times.
  std::size_t hand_over(CanBus& to, std::span<const CanFrame> out,
                        std::span<CanFrame> frames) override;
  /// How often hand_over() did with one call.
  std::int64_t num_exchanged() const { return num_exchanged_; }
  /// Throws std::logic_error when the bus was opened read-only.
  std::size_t write(std::span<const CanFrame> frames) override;
  /// True when the other end of a socketpair was closed.
  bool at_end() const override { return at_end_; }
  const BusCounters& counters() override;

 private:
  enum class State { kUp, kDown, kGone };

  void open_socket();
  void prepare_socket();
  void watch(int fd);
  void set_lingering(bool is_lingering);
  bool may_write_to_interface() const;
  void bind_to(int index);
  void check_link();
  void set_state(State state);
  bool can_exchange();
  std::size_t prepare_one(std::span<const CanFrame> out);
  void finish_one(int sent);
  std::size_t read_frames(std::span<CanFrame> frames, bool is_waiting);
  void on_read_error(int error);
  bool take(std::size_t i, CanFrame& frame);
  void on_error_frame(const CanFrame& frame);
  std::size_t fill(std::span<const CanFrame> frames);
  std::size_t send_filled(std::size_t num, WriteDeadline& deadline);
  bool wait_after(int error, WriteDeadline& deadline);
  void note_drops();
  void tell(const std::string& text) const;

  std::string name_;
  BusOptions options_;
  FileDescriptor wake_;  // epoll over the socket and the link monitor
  FileDescriptor socket_;
  std::unique_ptr<LinkMonitor> monitor_;  // none for a socketpair
  int bound_index_ = 0;
  int mtu_ = static_cast<int>(kKernelFrameBytesMax);
  int granted_bytes_ = 0;
  State state_ = State::kUp;
  bool is_bus_off_ = false;
  bool at_end_ = false;
  bool is_lingering_ = false;  // the socket is out of wake_: a frame then wakes one waiter, not two
  bool told_mtu_ = false;
  // As many as a batch holds: what queues meanwhile is taken at once by the next longer call.
  static constexpr int kSinglesMax = 63;
  int singles_left_ = 0;
  std::string last_error_text_;
  ReceiveBatch received_;
  SendBatch sending_;
  DropCounter drops_;
  BusCounters counters_;
  bool has_tried_ring_ = false;
  std::int64_t num_exchanged_ = 0;
  std::unique_ptr<RingExchange> ring_;  // none where the kernel has none; ends before its buffers
};

}  // namespace holdfast
