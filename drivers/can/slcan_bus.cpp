#include "drivers/can/slcan_bus.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/epoll.h>
#include <sys/timerfd.h>
#include <termios.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <stdexcept>
#include <utility>

#include "common/clock.h"
#include "common/errors.h"
#include "drivers/can/datagram_batch.h"
#include "drivers/serial_url.h"

namespace holdfast {
namespace {

// The protocol's numbers S0 to S8.
constexpr std::array<int, 9> kBitrates = {10'000,  20'000,  50'000,  100'000,  125'000,
                                          250'000, 500'000, 800'000, 1'000'000};
constexpr std::array<std::pair<int, speed_t>, 11> kBauds = {{{9600, B9600},
                                                             {19200, B19200},
                                                             {38400, B38400},
                                                             {57600, B57600},
                                                             {115200, B115200},
                                                             {230400, B230400},
                                                             {460800, B460800},
                                                             {500000, B500000},
                                                             {921600, B921600},
                                                             {1000000, B1000000},
                                                             {2000000, B2000000}}};
constexpr const char* kForm = "expected slcan:DEVICE[@BAUD][?bitrate=N][&fd_bitrate=N]";
constexpr std::int64_t kRetry_ns = 250'000'000, kSetUp_ns = 1'000'000'000;
constexpr std::size_t kReceivedMax = 1024;  // frames that are taken from the device at once

speed_t speed_of(const std::string& url, int baud) {
  std::string known;
  for (const auto& [number, speed] : kBauds) {
    if (number == baud) return speed;
    known += (known.empty() ? "" : ", ") + std::to_string(number);
  }
  throw UsageError(url + ": a serial line of " + std::to_string(baud) + " is none of: " + known);
}

std::string set_up_commands(const SlcanUrl& url, bool may_write) {
  const auto code = std::find(kBitrates.begin(), kBitrates.end(), url.bitrate) - kBitrates.begin();
  // Closed twice, since the first may only end what stood on the line. An empty line would do so
  // too, but not every adapter answers one, and answers are told by their number.
  std::string text = "C\rC\rS" + std::to_string(code) + "\r";
  if (url.fd_bitrate > 0) text += "Y" + std::to_string(url.fd_bitrate / 1'000'000) + "\r";
  return text + (may_write ? "O\r" : "L\r");
}

}  // namespace

SlcanUrl SlcanUrl::parse(const std::string& url) {
  constexpr std::string_view kScheme = "slcan:";
  const SerialUrl line = SerialUrl::parse(url, std::string_view(url).substr(kScheme.size()), kForm);
  SlcanUrl parsed;
  parsed.device = line.device;
  parsed.baud = line.baud.value_or(parsed.baud);
  speed_of(url, parsed.baud);
  for (const auto& [key, value] : line.options) {
    if (key == "bitrate") {
      parsed.bitrate = serial_number_of(url, value, kForm);
    } else if (key == "fd_bitrate") {
      parsed.fd_bitrate = serial_number_of(url, value, kForm);
    } else {
      throw UsageError(url + ": there is no option '" + key + "'; " + kForm);
    }
  }
  if (std::find(kBitrates.begin(), kBitrates.end(), parsed.bitrate) == kBitrates.end())
    throw UsageError(url +
                     ": bitrate must be 10000, 20000, 50000, 100000, 125000, 250000, "
                     "500000, 800000 or 1000000");
  if (parsed.fd_bitrate != 0 && parsed.fd_bitrate != 2'000'000 && parsed.fd_bitrate != 5'000'000)
    throw UsageError(url + ": fd_bitrate must be 2000000 or 5000000");
  return parsed;
}

SlcanBus::SlcanBus(const std::string& url, const BusOptions& options)
    : url_(SlcanUrl::parse(url)), options_(options) {
  if (options_.may_write && !options_.owns(url)) {
    throw UsageError(url + ": not a virtual bus; writing to it needs --i-own-this-bus " + url);
  }
  wake_ = FileDescriptor(epoll_create1(EPOLL_CLOEXEC));
  timer_ = FileDescriptor(timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC));
  watch(timer_.get());
  if (!open_device()) throw JobError(system_problem(url + ": cannot be opened", errno));
}

void SlcanBus::watch(int descriptor) {
  epoll_event event{};
  event.events = EPOLLIN;
  if (epoll_ctl(wake_.get(), EPOLL_CTL_ADD, descriptor, &event) != 0)
    throw JobError(system_problem(url_.device + ": cannot be watched", errno));
}

void SlcanBus::set_timer(std::int64_t first_ns, std::int64_t period_ns) {
  const itimerspec times{{0, period_ns}, {0, first_ns}};  // both below a second
  timerfd_settime(timer_.get(), 0, &times, nullptr);
}

bool SlcanBus::open_device() {
  FileDescriptor device(::open(url_.device.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  if (!device.is_open()) return false;
  termios line{};
  if (tcgetattr(device.get(), &line) != 0) return false;
  cfmakeraw(&line);
  line.c_cflag |= CLOCAL | CREAD;
  const speed_t speed = speed_of(url_.device, url_.baud);
  cfsetispeed(&line, speed);
  cfsetospeed(&line, speed);
  if (tcsetattr(device.get(), TCSANOW, &line) != 0) return false;
  tcflush(device.get(), TCIOFLUSH);
  device_ = std::move(device);
  watch(device_.get());
  reader_.reset();
  const std::string commands = set_up_commands(url_, options_.may_write);
  unanswered_ = 0;
  unanswered_set_up_ = std::count(commands.begin(), commands.end(), '\r');
  is_opened_to_listen_ = !options_.may_write;
  is_line_cut_ = false;
  return send(commands, monotonic_time_ns() + kSetUp_ns) == commands.size();
}

void SlcanBus::close_device(const std::string& why) {
  if (!device_.is_open()) return;
  device_ = FileDescriptor();  // which takes it out of the wait set, too
  ++counters_.times_down;
  set_timer(kRetry_ns, kRetry_ns);
  is_waking_ = false;
  tell(url_.device + " is gone (" + why + "): waiting");
}

void SlcanBus::try_again() {
  std::uint64_t expirations = 0;
  if (::read(timer_.get(), &expirations, sizeof expirations) <= 0) return;
  if (!open_device()) {
    device_ = FileDescriptor();
    return;
  }
  set_timer(0, 0);
  is_waking_ = false;
  tell(url_.device + " is back");
}

void SlcanBus::read_device() {
  std::array<char, 4096> bytes;
  while (device_.is_open() && received_.size() < kReceivedMax) {
    const ssize_t count = ::read(device_.get(), bytes.data(), bytes.size());
    if (count > 0) {
      reader_.take({bytes.data(), static_cast<std::size_t>(count)},
                   [this](SlcanLine kind, const CanFrame& frame, std::string_view line) {
                     on_line(kind, frame, line);
                   });
      continue;
    }
    if (count < 0 && (errno == EAGAIN || errno == EINTR)) return;
    return close_device(count == 0 ? "end of file" : system_problem("reading", errno));
  }
}

void SlcanBus::on_line(SlcanLine kind, const CanFrame& frame, std::string_view line) {
  switch (kind) {
    case SlcanLine::kFrame:
      received_.push_back(frame);
      received_.back().receive_time_ns = wall_utime() * 1000;
      break;
    case SlcanLine::kAcknowledged:
    case SlcanLine::kRefused:
      on_answer(line, kind == SlcanLine::kRefused);
      break;
    case SlcanLine::kBusState:
      on_bus_state(line);
      break;
    case SlcanLine::kBusError:
      ++counters_.error_frames;
      break;
    case SlcanLine::kAnswer:
      break;
    case SlcanLine::kBroken:
      ++counters_.refused;
      break;
  }
}

// Some adapters know no listen-only; what is not written to is opened like others then.
void SlcanBus::on_opening_refused() {
  if (options_.may_write || !std::exchange(is_opened_to_listen_, false))
    return tell(url_.device + " refuses to be opened");
  unanswered_set_up_ = 1;
  send("O\r", monotonic_time_ns() + kSetUp_ns);
  tell(url_.device + " cannot be opened listen-only: opened, and nothing is written");
}

// Answers come in order, from adapters that give them: first to the set-up, which may be refused in
// part, as when a channel that is closed is to be closed.
void SlcanBus::on_answer(std::string_view line, bool is_refused) {
  if (!line.empty()) unanswered_set_up_ = 0;  // "z" and "Z" are for frames only
  if (unanswered_set_up_ > 0) {
    const bool is_opening = --unanswered_set_up_ == 0;
    if (is_opening && is_refused) on_opening_refused();
    return;
  }
  if (unanswered_ == 0) return;
  --unanswered_;
  if (!is_refused) return;
  ++counters_.write_dropped;
  if (!std::exchange(has_refused_, true)) tell(url_.device + " refuses frames");
}

void SlcanBus::on_bus_state(std::string_view line) {
  const char state = line[1];
  if (state == std::exchange(bus_state_, state)) return;
  constexpr std::array<std::pair<char, const char*>, 4> kStates = {
      {{'a', "error-active"}, {'w', "error-warning"}, {'p', "error-passive"}, {'b', "bus-off"}}};
  for (const auto& [letter, text] : kStates) {
    if (letter == state) tell(url_.device + ": " + text);
  }
}

std::size_t SlcanBus::read(std::span<CanFrame> frames) {
  if (!device_.is_open()) try_again();
  if (next_ == received_.size()) {
    received_.clear();
    next_ = 0;
    read_device();
  }
  const std::size_t count = std::min(frames.size(), received_.size() - next_);
  std::copy_n(received_.begin() + static_cast<std::ptrdiff_t>(next_), count, frames.begin());
  next_ += count;
  counters_.read += static_cast<std::int64_t>(count);
  // One read of the device may hold more frames than were asked for, of which it says nothing more.
  const bool has_more = next_ < received_.size();
  if (!device_.is_open()) {
    // What came before it went is handed out first; then the timer wakes for the next try again.
    if (has_more || is_waking_) set_timer(has_more ? 1 : kRetry_ns, kRetry_ns);
  } else if (has_more != is_waking_) {
    set_timer(has_more ? 1 : 0, 0);
  }
  is_waking_ = has_more;
  return count;
}

std::size_t SlcanBus::send(std::string_view text, std::int64_t deadline_ns) {
  std::size_t sent = 0;
  while (sent < text.size() && device_.is_open()) {
    const ssize_t count = ::write(device_.get(), text.data() + sent, text.size() - sent);
    if (count > 0) {
      sent += static_cast<std::size_t>(count);
      continue;
    }
    if (count < 0 && errno != EAGAIN && errno != EINTR) {
      close_device(system_problem("writing", errno));
      break;
    }
    const std::int64_t left_ns = deadline_ns - monotonic_time_ns();
    if (left_ns <= 0) break;
    pollfd room{device_.get(), POLLOUT, 0};
    poll(&room, 1, static_cast<int>(left_ns / 1'000'000) + 1);
  }
  return sent;
}

std::size_t SlcanBus::write(std::span<const CanFrame> frames) {
  if (!options_.may_write) throw std::logic_error(url_.device + " was opened read-only");
  sending_.clear();
  // What is left of a line that was cut must not become the beginning of the next one.
  if (is_line_cut_) sending_ += '\r';
  const std::size_t num_before = is_line_cut_ ? 1 : 0;
  for (const CanFrame& frame : frames) {
    if (is_valid(frame)) append_slcan_line(frame, sending_);
  }
  const std::int64_t deadline_ns =
      monotonic_time_ns() + static_cast<std::int64_t>(options_.write_timeout_s * 1e9);
  const std::string_view sent = std::string_view(sending_).substr(0, send(sending_, deadline_ns));
  is_line_cut_ = sent.empty() ? is_line_cut_ : sent.back() != '\r';
  const auto num_ends = static_cast<std::size_t>(std::count(sent.begin(), sent.end(), '\r'));
  const std::size_t num_written = num_ends - std::min(num_ends, num_before);
  unanswered_ += static_cast<std::int64_t>(num_written);
  counters_.written += static_cast<std::int64_t>(num_written);
  counters_.write_dropped += static_cast<std::int64_t>(frames.size() - num_written);
  return num_written;
}

void SlcanBus::tell(const std::string& text) const {
  if (options_.on_event) options_.on_event(text);
}

}  // namespace holdfast
