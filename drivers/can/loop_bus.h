#pragma once

#include <deque>
#include <memory>
#include <utility>
#include <vector>

#include "drivers/can/can_bus.h"
#include "drivers/file_descriptor.h"

namespace holdfast {

class LoopBus;

/// The wire between the LoopBus objects of one process and one thread.
class LoopMedium {
 private:
  friend class LoopBus;
  std::vector<LoopBus*> buses_;
};

/// A bus inside the process: what one object writes, all others on its medium read, in order.
class LoopBus : public CanBus {
 public:
  static constexpr std::size_t kQueueMax = 65536;  // frames; more are dropped and counted

  explicit LoopBus(std::shared_ptr<LoopMedium> medium, const BusOptions& options = {});
  ~LoopBus() override;
  LoopBus(const LoopBus&) = delete;
  LoopBus& operator=(const LoopBus&) = delete;

  int file_descriptor() const override { return event_.get(); }
  std::size_t read(std::span<CanFrame> frames) override;
  std::size_t write(std::span<const CanFrame> frames) override;
  const BusCounters& counters() override { return counters_; }

 private:
  void deliver(const CanFrame& frame);

  std::shared_ptr<LoopMedium> medium_;
  bool may_write_;
  FileDescriptor event_;  // readable while frames wait
  std::deque<CanFrame> waiting_;
  BusCounters counters_;
};

/// Two writable buses on one medium.
std::pair<std::unique_ptr<LoopBus>, std::unique_ptr<LoopBus>> make_loop_pair();

}  // namespace holdfast
