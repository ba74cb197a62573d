#include "common/lcm_link.h"

#include <poll.h>

#include <algorithm>
#include <cstdlib>
#include <lcm/lcm-cpp.hpp>

#include "common/errors.h"
#include "common/lcm_socket_filter.h"

namespace holdfast {

namespace {

// handle_pending() returns after so many, so that a flood on one channel starves no other work.
constexpr int kMessagesPerCallMax = 10000;

}  // namespace

struct LcmLink::Subscription {
  std::string channel;
  RawHandler handler;
  Recorder recorder;  // instead of the handler, for every channel
  LinkCounters* counters = nullptr;

  static void on_message(const lcm_recv_buf_t* buffer, const char* name, void* subscription) {
    static_cast<Subscription*>(subscription)->handle(*buffer, name);
  }

  void record(const lcm_recv_buf_t& buffer, const char* name) {
    if (buffer.data_size > kLcmMessageBytesMax) return;
    try {
      recorder(name, buffer.recv_utime,
               {static_cast<const std::uint8_t*>(buffer.data), buffer.data_size});
    } catch (...) {
      ++counters->handler_errors;
    }
  }

  void handle(const lcm_recv_buf_t& buffer, const char* name) {
    if (recorder) return record(buffer, name);
    // A regular expression's end also matches before a last line feed.
    if (name != channel) {
      ++counters->refused;
      ++counters->refused_by_verdict["wrong_channel"];
      return;
    }
    if (buffer.data_size > kLcmMessageBytesMax) {
      ++counters->refused;
      ++counters->refused_by_verdict["too_long"];
      return;
    }
    // An exception must not travel through LCM's C frames.
    try {
      handler({static_cast<const std::uint8_t*>(buffer.data), buffer.data_size});
    } catch (...) {
      ++counters->handler_errors;
    }
  }
};

std::string exact_channel_pattern(const std::string& channel) {
  std::string pattern;
  for (const char c : channel) {
    if (std::string_view("\\^$.|?*+()[]{}").find(c) != std::string_view::npos) pattern += '\\';
    pattern += c;
  }
  return pattern;
}

std::string complete_lcm_url(const std::string& url, int receive_buffer_bytes) {
  std::string complete = url;
  if (complete.empty()) {
    const char* from_environment = std::getenv("LCM_DEFAULT_URL");
    complete = from_environment != nullptr && *from_environment != '\0'
                   ? from_environment
                   : "udpm://239.255.76.67:7667?ttl=0";
  }
  if (complete.rfind("udpm://", 0) != 0) return complete;
  const auto add = [&complete](const std::string& key, const std::string& value) {
    if (complete.find(key + "=") != std::string::npos) return;
    complete += complete.find('?') == std::string::npos ? '?' : '&';
    complete += key + "=" + value;
  };
  add("ttl", "0");
  add("recv_buf_size", std::to_string(receive_buffer_bytes));
  return complete;
}

LcmLink::LcmLink(const std::string& url, const LinkOptions& options)
    : url_(complete_lcm_url(url, options.receive_buffer_bytes)), options_(options) {
  lcm_ = std::make_unique<lcm::LCM>(url_);
  if (!lcm_->good()) {
    throw JobError(
        "LCM does not start at " + url_ +
        "\n  A multicast route is needed: 'ip route add 224.0.0.0/4 dev lo', or start through "
        "scripts/run, which makes a private network");
  }
}

LcmLink::~LcmLink() = default;

void LcmLink::subscribe_raw(const std::string& channel, RawHandler handler) {
  auto subscription = std::make_unique<Subscription>();
  subscription->channel = channel;
  subscription->handler = std::move(handler);
  add_subscription(std::move(subscription), exact_channel_pattern(channel),
                   options_.queue_capacity);
}

void LcmLink::record_all(Recorder recorder) {
  auto subscription = std::make_unique<Subscription>();
  subscription->recorder = std::move(recorder);
  add_subscription(std::move(subscription), ".*", 0);
}

void LcmLink::add_subscription(std::unique_ptr<Subscription> subscription,
                               const std::string& pattern, int queue_capacity) {
  subscription->counters = &counters_;
  const int port = udpm_port(url_);
  // LCM opens its receiving socket at the first subscription.
  const bool is_first = port != 0 && subscriptions_.empty();
  const std::vector<int> sockets_before = is_first ? udp_sockets_on_port(port) : std::vector<int>{};
  // By LCM's C interface: its C++ one calls through a pointer to member, of which GCC's
  // UndefinedBehaviorSanitizer says wrongly that it points to no object.
  lcm_subscription_t* handle = lcm_subscribe(lcm_->getUnderlyingLCM(), pattern.c_str(),
                                             &Subscription::on_message, subscription.get());
  if (handle == nullptr) throw JobError("cannot subscribe to " + pattern + " at " + url_);
  lcm_subscription_set_queue_capacity(handle, queue_capacity);
  subscriptions_.push_back(std::move(subscription));
  if (is_first) protect_receiving(sockets_before);
}

void LcmLink::protect_receiving(const std::vector<int>& sockets_before) {
  for (const int socket : udp_sockets_on_port(udpm_port(url_))) {
    if (std::find(sockets_before.begin(), sockets_before.end(), socket) != sockets_before.end())
      continue;
    if (attach_lcm_filter(socket)) receive_socket_ = socket;
  }
}

const LinkCounters& LcmLink::counters() const {
  if (receive_socket_ >= 0) counters_.kernel_drops = socket_drops(receive_socket_);
  return counters_;
}

bool LcmLink::accept(const TypeLayout& type, std::int64_t fingerprint,
                     std::span<const std::uint8_t> buffer) {
  const GuardVerdict verdict = check_wire(type, fingerprint, buffer);
  if (verdict == GuardVerdict::kOk) {
    ++counters_.received;
    return true;
  }
  ++counters_.refused;
  ++counters_.refused_by_verdict[to_string(verdict)];
  return false;
}

void LcmLink::note_seq(const std::string& channel, std::int64_t seq) {
  // A forged number must neither overflow nor make every later one look old.
  constexpr std::int64_t kSeqMax = std::int64_t{1} << 40;
  constexpr std::int64_t kGapMax = 1'000'000;
  if (seq < 0 || seq > kSeqMax) {
    ++counters_.out_of_order;
    return;
  }
  const auto found = next_seq_in_.find(channel);
  if (found == next_seq_in_.end()) {
    next_seq_in_.emplace(channel, seq + 1);
    return;
  }
  if (seq < found->second || seq - found->second > kGapMax) {
    ++counters_.out_of_order;
    return;
  }
  counters_.lost += seq - found->second;
  found->second = seq + 1;
}

std::vector<std::uint8_t>& LcmLink::scratch(std::size_t size) {
  scratch_.resize(size);
  return scratch_;
}

bool LcmLink::publish_bytes(const std::string& channel, const void* bytes, std::size_t size) {
  const bool is_sent = lcm_->publish(channel, bytes, static_cast<unsigned int>(size)) == 0;
  if (!is_sent) ++counters_.publish_failures;
  return is_sent;
}

int LcmLink::file_descriptor() const {
  return lcm_->getFileno();
}

void LcmLink::handle_pending() {
  // lcm_handle_timeout uses select(), which descriptors above 1023 break; poll() has no such limit.
  pollfd descriptor{lcm_->getFileno(), POLLIN, 0};
  for (int handled = 0; handled < kMessagesPerCallMax && poll(&descriptor, 1, 0) > 0; ++handled) {
    if (lcm_->handle() != 0) return;
  }
}

}  // namespace holdfast
