#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "common/lcm_guard.h"

namespace lcm {
class LCM;
}

namespace holdfast {

/// What went wrong on the link, by kind; all zero in a healthy run.
struct LinkCounters {
  std::int64_t received = 0;          // messages that passed the guard
  std::int64_t kernel_drops = 0;      // datagrams dropped: malformed, or more than the buffer holds
  std::int64_t refused = 0;           // buffers that did not; one counter by verdict below
  std::int64_t lost = 0;              // gaps of seq
  std::int64_t out_of_order = 0;      // seq that went back, or leapt as only a forged one does
  std::int64_t handler_errors = 0;    // exceptions that a handler threw
  std::int64_t publish_failures = 0;  // the kernel refused it, or the channel's name is too long
  std::map<std::string, std::int64_t> refused_by_verdict;
};

struct LinkOptions {
  int queue_capacity = 20000;  // messages per subscription; LCM's own default of 30 loses silently
  int receive_buffer_bytes = 1 << 22;  // asked of the kernel through the URL
};

/// The only way to LCM: subscribes raw by exact channel name, checks before decoding, counts
/// losses.
///
/// One thread. Handlers run inside handle_pending(); what they throw is counted, never passed on.
class LcmLink {
 public:
  /// Opens the URL ("" means $LCM_DEFAULT_URL, else LCM's default with ttl=0).
  /// Throws JobError when LCM cannot start there: no route, wrong URL.
  explicit LcmLink(const std::string& url, const LinkOptions& options = {});
  ~LcmLink();
  LcmLink(const LcmLink&) = delete;
  LcmLink& operator=(const LcmLink&) = delete;

  /// Calls the handler for each message on exactly this channel that passes the guard.
  template <class Message>
  void subscribe(const std::string& channel, std::function<void(const Message&)> handler);

  /// Hands on every message of every channel, unchecked, in order of arrival, for a recorder:
  /// channel, LCM's receive stamp (us), bytes. Its queue has no bound, so that nothing is lost
  /// here.
  using Recorder =
      std::function<void(const std::string&, std::int64_t, std::span<const std::uint8_t>)>;
  void record_all(Recorder recorder);

  /// Publishes with the channel's next seq. Returns false when the kernel refused it (counted).
  template <class Message>
  bool publish(const std::string& channel, Message& message);

  /// Publishes bytes as they are, for tests and replays.
  bool publish_bytes(const std::string& channel, const void* bytes, std::size_t size);

  /// Descriptor that is readable when handle_pending() has work.
  int file_descriptor() const;
  /// Handles what has arrived and returns without waiting. Returns early under a flood; the
  /// descriptor stays readable then.
  void handle_pending();

  const LinkCounters& counters() const;
  const std::string& url() const { return url_; }

 private:
  using RawHandler = std::function<void(std::span<const std::uint8_t>)>;
  struct Subscription;

  void subscribe_raw(const std::string& channel, RawHandler handler);
  bool accept(const TypeLayout& type, std::int64_t fingerprint,
              std::span<const std::uint8_t> buffer);
  void add_subscription(std::unique_ptr<Subscription> subscription, const std::string& pattern,
                        int queue_capacity);
  void protect_receiving(const std::vector<int>& sockets_before);
  void note_seq(const std::string& channel, std::int64_t seq);
  std::vector<std::uint8_t>& scratch(std::size_t size);

  std::string url_;
  LinkOptions options_;
  std::unique_ptr<lcm::LCM> lcm_;
  std::vector<std::unique_ptr<Subscription>> subscriptions_;
  std::map<std::string, std::int64_t> next_seq_out_;
  std::map<std::string, std::int64_t> next_seq_in_;
  std::vector<std::uint8_t> scratch_;
  int receive_socket_ = -1;  // LCM's; only asked for its drops
  mutable LinkCounters counters_;
};

/// Escapes what a regular expression would read as an operator; LCM reads channel names as such.
std::string exact_channel_pattern(const std::string& channel);

/// The URL with recv_buf_size, and with ttl=0 unless it says otherwise.
std::string complete_lcm_url(const std::string& url, int receive_buffer_bytes);

}  // namespace holdfast

#include "common/lcm_link_templates.h"
