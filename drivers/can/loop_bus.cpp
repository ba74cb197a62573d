#include "drivers/can/loop_bus.h"

#include <sys/eventfd.h>

#include <algorithm>
#include <stdexcept>

#include "common/clock.h"
#include "common/errors.h"

namespace holdfast {

LoopBus::LoopBus(std::shared_ptr<LoopMedium> medium, const BusOptions& options)
    : medium_(std::move(medium)),
      may_write_(options.may_write),
      event_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
  if (!event_.is_open()) throw JobError("loop bus: no descriptor left");
  medium_->buses_.push_back(this);
}

LoopBus::~LoopBus() {
  std::erase(medium_->buses_, this);
}

std::size_t LoopBus::read(std::span<CanFrame> frames) {
  const std::size_t num_read = std::min(frames.size(), waiting_.size());
  const auto end = waiting_.begin() + static_cast<std::ptrdiff_t>(num_read);
  std::copy(waiting_.begin(), end, frames.begin());
  waiting_.erase(waiting_.begin(), end);
  if (num_read > 0 && waiting_.empty()) {
    eventfd_t count = 0;
    eventfd_read(event_.get(), &count);
  }
  counters_.read += static_cast<std::int64_t>(num_read);
  return num_read;
}

std::size_t LoopBus::write(std::span<const CanFrame> frames) {
  if (!may_write_) throw std::logic_error("the bus was opened read-only");
  std::size_t num_written = 0;
  for (CanFrame frame : frames) {
    if (!is_valid(frame) || frame.has(CanFrame::kError)) {
      ++counters_.write_dropped;
      continue;
    }
    frame.receive_time_ns = wall_utime() * 1000;
    for (LoopBus* bus : medium_->buses_) {
      if (bus != this) bus->deliver(frame);
    }
    ++num_written;
  }
  counters_.written += static_cast<std::int64_t>(num_written);
  return num_written;
}

void LoopBus::deliver(const CanFrame& frame) {
  if (waiting_.size() == kQueueMax) {
    ++counters_.kernel_dropped;
    return;
  }
  if (waiting_.empty()) eventfd_write(event_.get(), 1);
  waiting_.push_back(frame);
}

std::pair<std::unique_ptr<LoopBus>, std::unique_ptr<LoopBus>> make_loop_pair() {
  BusOptions options;
  options.may_write = true;
  auto medium = std::make_shared<LoopMedium>();
  return {std::make_unique<LoopBus>(medium, options), std::make_unique<LoopBus>(medium, options)};
}

}  // namespace holdfast
