#include "drivers/can/ring_exchange.h"

#include <sys/socket.h>

#include <cerrno>
#include <cmath>
#include <system_error>

namespace holdfast {
namespace {

constexpr unsigned kEntries = 8;
constexpr std::uint64_t kSend = 1, kReceive = 2, kTick = 3, kCancel = 4;

}  // namespace

std::unique_ptr<RingExchange> RingExchange::open(double wait_s) {
  std::unique_ptr<RingExchange> exchange(new RingExchange(wait_s));
  // Work that waits for the caller's next call interrupts nobody.
  constexpr unsigned kFlags = IORING_SETUP_SINGLE_ISSUER | IORING_SETUP_DEFER_TASKRUN;
  const int status = io_uring_queue_init(kEntries, &exchange->ring_, kFlags);
  if (status < 0) {
    exchange->ring_.ring_fd = -1;
    return nullptr;
  }
  return exchange;
}

RingExchange::RingExchange(double wait_s) {
  const double whole_s = std::floor(wait_s);
  wait_.tv_sec = static_cast<std::int64_t>(whole_s);
  wait_.tv_nsec = static_cast<std::int64_t>((wait_s - whole_s) * 1e9);
}

RingExchange::~RingExchange() {
  if (ring_.ring_fd >= 0) io_uring_queue_exit(&ring_);
}

RingExchange::Result RingExchange::exchange(int from, std::span<std::uint8_t> room, int to,
                                            std::span<const std::uint8_t> out) {
  result_ = {static_cast<int>(out.size()), -EAGAIN};
  if (!out.empty()) add_send(to, out);
  add_receive(from, room);
  bool has_own_tick = false;
  while (is_receiving_) {
    if (!has_tick_) {
      // A tick of an earlier call may have come too soon for this one.
      if (has_own_tick || result_.sent < 0) break;
      has_own_tick = true;
      add_tick();
    }
    const int status = wait();
    if (status < 0) throw std::system_error(-status, std::generic_category(), "io_uring");
    if (result_.sent < 0) break;
  }
  if (is_receiving_) cancel_receive();
  return result_;
}

void RingExchange::add_send(int to, std::span<const std::uint8_t> out) {
  io_uring_sqe* const entry = io_uring_get_sqe(&ring_);
  io_uring_prep_send(entry, to, out.data(), out.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
  entry->flags |= IOSQE_CQE_SKIP_SUCCESS;
  entry->user_data = kSend;
}

void RingExchange::add_receive(int from, std::span<std::uint8_t> room) {
  io_uring_sqe* const entry = io_uring_get_sqe(&ring_);
  io_uring_prep_recv(entry, from, room.data(), room.size(), MSG_TRUNC);
  entry->user_data = kReceive;
  is_receiving_ = true;
}

void RingExchange::add_tick() {
  io_uring_sqe* const entry = io_uring_get_sqe(&ring_);
  io_uring_prep_timeout(entry, &wait_, 0, 0);
  entry->user_data = kTick;
  has_tick_ = true;
}

void RingExchange::cancel_receive() {
  io_uring_sqe* const entry = io_uring_get_sqe(&ring_);
  io_uring_prep_cancel64(entry, kReceive, 0);
  entry->user_data = kCancel;
  is_cancelling_ = true;
  while (is_receiving_ || is_cancelling_) {
    const int status = wait();
    if (status < 0) throw std::system_error(-status, std::generic_category(), "io_uring");
  }
}

// Hands over what was added, and waits for a result.
int RingExchange::wait() {
  const int status = io_uring_submit_and_wait(&ring_, 1);
  if (status < 0 && status != -EINTR && status != -EAGAIN && status != -EBUSY) return status;
  take_results();
  return 0;
}

void RingExchange::take_results() {
  io_uring_cqe* entry = nullptr;
  unsigned head = 0, count = 0;
  io_uring_for_each_cqe(&ring_, head, entry) {
    ++count;
    switch (entry->user_data) {
      case kSend:
        result_.sent = entry->res;
        break;
      case kReceive:
        is_receiving_ = false;
        result_.received = entry->res == -ECANCELED ? -EAGAIN : entry->res;
        break;
      case kTick:
        has_tick_ = false;
        break;
      case kCancel:
        is_cancelling_ = false;
        break;
      default:
        break;
    }
  }
  io_uring_cq_advance(&ring_, count);
}

}  // namespace holdfast
