#include "drivers/event_loop.h"

#include <fcntl.h>
#include <poll.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <system_error>

#include "common/clock.h"
#include "common/errors.h"
#include "drivers/can/can_bus.h"

namespace holdfast {

namespace asio = boost::asio;
using boost::system::error_code;
using Clock = asio::steady_timer::clock_type;

/// Kept alive by the operation that it waits with, and by nothing else.
struct EventLoop::Source : std::enable_shared_from_this<Source> {
  explicit Source(Work on_event) : work(std::move(on_event)) {}
  virtual ~Source() = default;
  virtual void cancel() = 0;

  /// Calls the work; false when the source was stopped meanwhile.
  bool fire() {
    if (is_stopped) return false;
    work();
    return !is_stopped;
  }

  template <class Self>
  std::shared_ptr<Self> self(Self* me) {
    return std::shared_ptr<Self>(shared_from_this(), me);
  }

  Work work;
  bool is_stopped = false;
};

struct EventLoop::Context {
  asio::io_context io{1};
};

namespace {

constexpr std::chrono::milliseconds kTroubleDelay{50};

/// A descriptor of our own on the same file: Asio closes what it is given.
int duplicate(int fd) {
  const int copy = fcntl(fd, F_DUPFD_CLOEXEC, 0);
  if (copy < 0)
    throw JobError("cannot watch a descriptor: " + std::generic_category().message(errno));
  return copy;
}

bool is_in_trouble(int fd) {
  pollfd state{fd, 0, 0};
  return poll(&state, 1, 0) > 0 && (state.revents & (POLLERR | POLLHUP | POLLNVAL)) != 0;
}

void check(const error_code& error) {
  if (error) throw JobError("cannot wait for a descriptor: " + error.message());
}

struct DescriptorSource : EventLoop::Source {
  DescriptorSource(asio::io_context& io, int fd, EventLoop::Work on_event)
      : Source(std::move(on_event)), descriptor(io, duplicate(fd)), delay(io) {}

  void arm() {
    descriptor.async_wait(asio::posix::stream_descriptor::wait_read,
                          [me = self(this)](const error_code& error) {
                            if (me->is_stopped || error == asio::error::operation_aborted) return;
                            check(error);
                            if (me->fire()) me->arm_again();
                          });
  }

  virtual void arm_again() {
    if (!is_in_trouble(descriptor.native_handle())) return arm();
    delay.expires_after(kTroubleDelay);
    delay.async_wait([me = self(this)](const error_code& error) {
      if (!error && !me->is_stopped) me->arm();
    });
  }

  void cancel() override {
    error_code ignored;
    descriptor.close(ignored);
    delay.cancel();
  }

  asio::posix::stream_descriptor descriptor;
  asio::steady_timer delay;
};

/// Buses take their own errors off their descriptor, so that there is no trouble to look for.
struct BusSource : DescriptorSource {
  BusSource(asio::io_context& io, CanBus& watched, EventLoop::Work on_event)
      : DescriptorSource(io, watched.file_descriptor(), std::move(on_event)),
        bus(watched),
        watched_fd(watched.file_descriptor()) {}

  void arm_again() override {
    if (bus.file_descriptor() != watched_fd) {
      watched_fd = bus.file_descriptor();
      descriptor.close();
      descriptor.assign(duplicate(watched_fd));
    }
    arm();
  }

  CanBus& bus;
  int watched_fd;
};

struct FileBusSource : EventLoop::Source {
  FileBusSource(asio::io_context& loop, CanBus& watched, EventLoop::Work on_event)
      : Source(std::move(on_event)), io(loop), bus(watched) {}

  void arm() {
    asio::post(io, [me = self(this)] {
      if (me->fire() && !me->bus.at_end()) me->arm();
    });
  }
  void cancel() override {}

  asio::io_context& io;
  CanBus& bus;
};

struct TimerSource : EventLoop::Source {
  TimerSource(asio::io_context& io, double delay_s, EventLoop::Work on_event)
      : Source(std::move(on_event)),
        period(std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(delay_s))),
        timer(io, period) {}

  void arm() {
    timer.async_wait([me = self(this)](const error_code& error) {
      if (error || !me->fire() || !me->is_periodic) return;
      const auto now = std::chrono::nanoseconds(monotonic_time_ns());  // steady_clock's own
      const auto late = now - me->timer.expiry().time_since_epoch();
      const auto missed = late > me->period ? late / me->period - 1 : 0;
      me->timer.expires_at(me->timer.expiry() + me->period * (missed + 1));
      me->arm();
    });
  }
  void cancel() override { timer.cancel(); }

  Clock::duration period;
  bool is_periodic = false;
  asio::steady_timer timer;
};

struct SignalSource : EventLoop::Source {
  SignalSource(asio::io_context& io, EventLoop::Work on_event)
      : Source(std::move(on_event)), signals(io, SIGINT, SIGTERM) {}

  void arm() {
    signals.async_wait([me = self(this)](const error_code& error, int) {
      if (!error && me->fire()) me->arm();
    });
  }
  void cancel() override { signals.cancel(); }

  asio::signal_set signals;
};

}  // namespace

void EventLoop::Watch::stop() {
  const std::shared_ptr<Source> source = source_.lock();
  if (!source || source->is_stopped) return;
  source->is_stopped = true;
  source->cancel();
}

EventLoop::EventLoop() : context_(std::make_unique<Context>()) {}
EventLoop::~EventLoop() = default;

EventLoop::Watch EventLoop::watch(int fd, Work on_readable) {
  const auto source = std::make_shared<DescriptorSource>(context_->io, fd, std::move(on_readable));
  source->arm();
  return Watch(source);
}

EventLoop::Watch EventLoop::watch_bus(CanBus& bus, Work on_readable) {
  if (bus.file_descriptor() < 0) {
    const auto source = std::make_shared<FileBusSource>(context_->io, bus, std::move(on_readable));
    source->arm();
    return Watch(source);
  }
  const auto source = std::make_shared<BusSource>(context_->io, bus, std::move(on_readable));
  source->arm();
  return Watch(source);
}

EventLoop::Watch EventLoop::every(double period_s, Work on_time) {
  if (!(period_s >= 1e-9)) throw UsageError("a timer's period must be above 0");
  const auto source = std::make_shared<TimerSource>(context_->io, period_s, std::move(on_time));
  source->is_periodic = true;
  source->arm();
  return Watch(source);
}

EventLoop::Watch EventLoop::after(double delay_s, Work on_time) {
  const auto source = std::make_shared<TimerSource>(context_->io, delay_s, std::move(on_time));
  source->arm();
  return Watch(source);
}

EventLoop::Watch EventLoop::on_stop_signal(Work on_signal) {
  const auto source = std::make_shared<SignalSource>(context_->io, std::move(on_signal));
  source->arm();
  return Watch(source);
}

void EventLoop::run() {
  context_->io.run();
  context_->io.restart();
}

void EventLoop::run_for(double duration_s) {
  context_->io.run_for(std::chrono::nanoseconds(static_cast<std::int64_t>(duration_s * 1e9)));
  context_->io.restart();
}

void EventLoop::stop() {
  context_->io.stop();
}

}  // namespace holdfast
