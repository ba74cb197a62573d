#pragma once

#include <functional>
#include <memory>

namespace holdfast {

class CanBus;

/// Waits for descriptors, timers and signals, and calls what was registered, in one thread.
///
/// What a callback throws comes out of run(). Callbacks may register and stop watches, and may call
/// stop(). A watch lives until it is stopped or the loop is destroyed; its handle may be dropped.
class EventLoop {
 public:
  using Work = std::function<void()>;

  /// What a registered callback waits for.
  struct Source;

  /// Handle of one registered callback.
  class Watch {
   public:
    Watch() = default;
    /// The callback is not called again.
    void stop();

   private:
    friend class EventLoop;
    explicit Watch(std::weak_ptr<Source> source) : source_(std::move(source)) {}
    std::weak_ptr<Source> source_;
  };

  EventLoop();
  ~EventLoop();
  EventLoop(const EventLoop&) = delete;
  EventLoop& operator=(const EventLoop&) = delete;

  /// Calls whenever the descriptor is readable; the owner keeps and closes it. One that is in error
  /// or hung up is called for every 50 ms only. Throws JobError for a descriptor that cannot wait.
  Watch watch(int fd, Work on_readable);

  /// Calls whenever the bus has frames, and follows it when its descriptor changes. A bus without a
  /// descriptor (a file) is called for again and again, between other work, until it is at_end().
  /// The bus must outlive the watch.
  Watch watch_bus(CanBus& bus, Work on_readable);

  /// Calls at multiples of the period from now (absolute deadlines, no drift). A deadline that
  /// passed while other work ran is made up for once, the further missed ones are left out.
  Watch every(double period_s, Work on_time);
  Watch after(double delay_s, Work on_time);

  /// Calls on SIGINT and SIGTERM, which then no longer end the process.
  Watch on_stop_signal(Work on_signal);

  /// Runs until stop(), or until nothing is watched any more. Returns at once after an earlier
  /// stop().
  void run();
  /// The same, but for no longer than this.
  void run_for(double duration_s);
  void stop();

 private:
  struct Context;
  std::unique_ptr<Context> context_;
};

}  // namespace holdfast
