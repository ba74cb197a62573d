#include "common/lcm_link.h"

#include <cstdlib>
#include <functional>
#include <map>
#include <stdexcept>

#include "common/clock.h"
#include "common/errors.h"
#include "common/pacer.h"
#include "common/random_stream.h"
#include "common/status.h"
#include "tests/component/common/datagrams.h"
#include "tests/support/catch.h"
#include "tests/support/message_types.h"
#include "tests/support/wire_sample.h"

namespace holdfast {
namespace {

using testing::Datagrams;

// Each test case has a port of its own: LCM 1.3.1 tells runs apart by their port only.
constexpr const char* kGroup = "239.255.76.67";

struct Ends {
  std::string url;
  LcmLink sender;
  LcmLink receiver;

  explicit Ends(int port, const LinkOptions& options = {})
      : url("udpm://" + std::string(kGroup) + ":" + std::to_string(port) + "?ttl=0"),
        sender(url),
        receiver(url, options) {}

  bool wait_until(const std::function<bool()>& condition) {
    const std::int64_t deadline_ns = monotonic_time_ns() + 10'000'000'000;
    Pacer pacer(0.001);
    while (monotonic_time_ns() < deadline_ns) {
      receiver.handle_pending();
      if (condition()) return true;
      pacer.wait();
    }
    return false;
  }
};

known_input_t message_of(double value) {
  known_input_t message{};
  message.num_inputs = 1;
  message.input = {value};
  return message;
}

std::vector<std::uint8_t> hostile_length(std::int32_t length) {
  auto sample = testing::wire_sample(*layouts::of<known_input_t>, known_input_t::getHash(), 1);
  sample.overwrite_int32(sample.array_lengths[0], length);
  return sample.bytes;
}

}  // namespace

TEST_CASE(
    "hostile messages are refused and counted by kind, and genuine ones arrive all the same") {
  Ends ends(20101);
  std::vector<double> values;
  ends.receiver.subscribe<known_input_t>(
      "INPUT", [&](const known_input_t& message) { values.push_back(message.input.at(0)); });
  known_input_t genuine = message_of(1.0);
  ends.sender.publish("INPUT", genuine);
  const auto send = [&](const std::vector<std::uint8_t>& bytes) {
    CHECK(ends.sender.publish_bytes("INPUT", bytes.data(), bytes.size()));
  };
  for (const std::int32_t length : {-1, 2'000'000'000, 536'870'912}) send(hostile_length(length));
  const auto whole = testing::encoded(message_of(9.0));
  auto wrong_type = whole;
  wrong_type[3] ^= 1;
  send(wrong_type);
  send({whole.begin(), whole.begin() + 5});
  send({whole.begin(), whole.begin() + 20});
  auto longer = whole;
  longer.push_back(0);
  send(longer);
  genuine = message_of(2.0);
  ends.sender.publish("INPUT", genuine);
  REQUIRE(ends.wait_until([&] { return values.size() == 2; }));
  CHECK(values == std::vector<double>{1.0, 2.0});
  const LinkCounters& counters = ends.receiver.counters();
  CHECK(counters.received == 2);
  CHECK(counters.refused == 7);
  CHECK(counters.refused_by_verdict.at("bad_length") == 3);
  CHECK(counters.refused_by_verdict.at("wrong_fingerprint") == 1);
  CHECK(counters.refused_by_verdict.at("too_short") == 1);
  CHECK(counters.refused_by_verdict.at("truncated") == 1);
  CHECK(counters.refused_by_verdict.at("trailing_bytes") == 1);
  CHECK(counters.lost == 0);
}

TEST_CASE("random and malformed datagrams leave the link alive") {
  constexpr int kPort = 20102;
  Ends ends(kPort);
  double value = 0.0;
  ends.receiver.subscribe<known_input_t>(
      "INPUT", [&](const known_input_t& message) { value = message.input.at(0); });
  const Datagrams datagrams(kGroup, kPort);
  const RandomStream random(1, 0, "datagrams");
  const auto inner = testing::encoded(message_of(5.0));
  for (std::uint32_t i = 0; i < 2000; ++i) {
    std::vector<std::uint8_t> bytes = datagrams.small_message("INPUT", inner);
    switch (i % 4) {
      case 0:  // noise
        bytes.resize(static_cast<std::size_t>(random.uniform(i, 0) * 100.0));
        for (std::size_t j = 0; j < bytes.size(); ++j) {
          bytes[j] = static_cast<std::uint8_t>(random.uniform(i, j + 1) * 256.0);
        }
        break;
      case 1:  // cut
        bytes.resize(
            static_cast<std::size_t>(random.uniform(i, 0) * static_cast<double>(bytes.size())));
        break;
      case 2:  // one byte of header or channel spoilt
        bytes[static_cast<std::size_t>(random.uniform(i, 0) * 14.0)] ^= 0xFF;
        break;
      default:  // a channel's name without end
        bytes.resize(8);
        bytes.resize(200, 'A');
    }
    datagrams.send(bytes);
  }
  known_input_t genuine = message_of(3.0);
  // The kernel may drop datagrams of a flood; the genuine one is repeated until it comes through.
  REQUIRE(ends.wait_until([&] {
    ends.sender.publish("INPUT", genuine);
    return value == 3.0;
  }));
  CHECK(ends.receiver.counters().kernel_drops > 0);
}

TEST_CASE("a channel's name that ends beyond its datagram reaches nobody") {
  constexpr int kPort = 20111;
  Ends ends(kPort);
  int num_received = 0;
  ends.receiver.subscribe<known_input_t>("INPUT", [&](const known_input_t&) { ++num_received; });
  const Datagrams datagrams(kGroup, kPort);
  // LCM's buffer still holds the end of the name from the message before.
  const auto whole = datagrams.small_message("INPUT", testing::encoded(message_of(1.0)));
  for (int i = 0; i < 100; ++i) {
    datagrams.send(whole);
    datagrams.send({whole.begin(), whole.begin() + 13});
  }
  REQUIRE(ends.wait_until([&] { return num_received == 100; }));
  CHECK(ends.receiver.counters().refused == 0);
  CHECK(ends.receiver.counters().kernel_drops == 100);
}

TEST_CASE("hostile fragments leave the link alive") {
  constexpr int kPort = 20103;
  Ends ends(kPort);
  std::size_t num_inputs = 0;
  ends.receiver.subscribe<known_input_t>(
      "INPUT", [&](const known_input_t& message) { num_inputs = message.input.size(); });
  const Datagrams datagrams(kGroup, kPort);
  const std::uint32_t sizes[] = {0, 1, 100, 0x7FFFFFFF, 0xFFFFFFFF};
  const std::uint32_t offsets[] = {0, 50, 0x7FFFFFF0, 0xFFFFFFF0};
  const std::uint16_t numbers[] = {0, 1, 0xFFFF};
  std::uint32_t sequence = 1000;
  for (const std::uint32_t size : sizes) {
    for (const std::uint32_t offset : offsets) {
      for (const std::uint16_t number : numbers) {
        for (const std::uint16_t count : numbers) {
          datagrams.send(datagrams.fragment(++sequence, size, offset, number, count, "INPUT"));
        }
      }
    }
  }
  // A message of many genuine fragments still comes together: 8 bytes each, beyond LCM's 65499 a
  // piece.
  known_input_t large = message_of(0.0);
  large.num_inputs = 30'000;
  large.input.assign(30'000, 1.5);
  REQUIRE(ends.wait_until([&] {
    if (num_inputs == 0) ends.sender.publish("INPUT", large);
    return num_inputs == 30'000;
  }));
  CHECK(ends.receiver.counters().kernel_drops > 0);
}

TEST_CASE("a subscription is to one exact channel") {
  Ends ends(20104);
  int num_received = 0;
  bool is_over = false;
  ends.receiver.subscribe<known_input_t>("A.B", [&](const known_input_t&) { ++num_received; });
  ends.receiver.subscribe<known_input_t>("END", [&](const known_input_t&) { is_over = true; });
  known_input_t message = message_of(0.0);
  for (const char* channel : {"AxB", "A.BC", "XA.B", "A", "a.b", "A.B"})
    ends.sender.publish(channel, message);
  // LCM's regular expression takes this one for A.B; the link does not.
  ends.sender.publish("A.B\n", message);
  ends.sender.publish("END", message);
  REQUIRE(ends.wait_until([&] { return is_over; }));
  CHECK(num_received == 1);
  CHECK(ends.receiver.counters().refused_by_verdict.at("wrong_channel") == 1);
}

TEST_CASE("gaps and steps back of seq are counted, channel by channel") {
  Ends ends(20105);
  int num_received = 0;
  for (const char* channel : {"A", "B"}) {
    ends.receiver.subscribe<known_input_t>(channel, [&](const known_input_t&) { ++num_received; });
  }
  const auto send = [&](const char* channel, std::int64_t seq) {
    known_input_t message = message_of(0.0);
    message.seq = seq;
    const auto bytes = testing::encoded(message);
    ends.sender.publish_bytes(channel, bytes.data(), bytes.size());
  };
  // A: 2 to 4 and 6 lost, 1 came late. A forged seq must not make 8 look lost or old.
  const std::int64_t seqs[] = {0, 1, 5, 1, 7, -1, std::int64_t{1} << 62, 500'000'000, 8};
  for (const std::int64_t seq : seqs) send("A", seq);
  // B begins late, as for one who joins late: nothing is lost.
  for (const std::int64_t seq : {100, 101}) send("B", seq);
  REQUIRE(ends.wait_until([&] { return num_received == 11; }));
  CHECK(ends.receiver.counters().lost == 4);
  CHECK(ends.receiver.counters().out_of_order == 4);
}

TEST_CASE("whatever a handler throws stays inside, and is counted") {
  Ends ends(20106);
  int num_calls = 0;
  ends.receiver.subscribe<known_input_t>("INPUT", [&](const known_input_t&) {
    ++num_calls;
    if (num_calls == 1) throw std::runtime_error("first");
    if (num_calls == 2) throw 2;
  });
  known_input_t message = message_of(0.0);
  for (int i = 0; i < 3; ++i) ends.sender.publish("INPUT", message);
  REQUIRE(ends.wait_until([&] { return num_calls == 3; }));
  CHECK(ends.receiver.counters().handler_errors == 2);
  CHECK(ends.receiver.counters().received == 3);
}

TEST_CASE("a burst that nobody handles meanwhile is kept whole; with LCM's own queue it is not") {
  constexpr int kBurst = 5000;
  const auto burst = [](Ends& ends) {
    known_input_t message = message_of(0.0);
    // A hundred a millisecond: the test is of LCM's queue, not of the kernel's buffer, whose size
    // is the administrator's.
    Pacer pacer(0.001);
    for (int i = 0; i < kBurst; ++i) {
      if (i % 100 == 0) pacer.wait();
      REQUIRE(ends.sender.publish("INPUT", message));
    }
  };
  int num_received = 0;
  const auto count = [&](const known_input_t&) { ++num_received; };
  SECTION("ours") {
    Ends ends(20107);
    ends.receiver.subscribe<known_input_t>("INPUT", count);
    burst(ends);
    REQUIRE(ends.wait_until([&] { return num_received == kBurst; }));
    CHECK(ends.receiver.counters().lost == 0);
  }
  SECTION("LCM's") {
    LinkOptions options;
    options.queue_capacity = 30;
    Ends ends(20108, options);
    ends.receiver.subscribe<known_input_t>("INPUT", count);
    burst(ends);
    // Only what comes after a loss can tell of it.
    known_input_t last = message_of(0.0);
    REQUIRE(ends.wait_until([&] {
      ends.sender.publish("INPUT", last);
      return ends.receiver.counters().lost > 0;
    }));
    CHECK(num_received < kBurst);
  }
}

TEST_CASE("a flood does not keep the caller inside, and nothing of it is forgotten") {
  LcmLink link("memq://");
  constexpr int kFlood = 25'000;
  int num_received = 0;
  link.subscribe<known_input_t>("INPUT", [&](const known_input_t&) { ++num_received; });
  known_input_t message = message_of(0.0);
  for (int i = 0; i < kFlood; ++i) link.publish("INPUT", message);
  link.handle_pending();
  CHECK(num_received > 0);
  CHECK(num_received < kFlood);
  for (int calls = 0; calls < 10 && num_received < kFlood; ++calls) link.handle_pending();
  CHECK(num_received == kFlood);
}

TEST_CASE("a recorder gets every channel's bytes as they were sent, beside a subscriber") {
  Ends ends(20112);
  std::map<std::string, std::vector<std::uint8_t>> recorded;
  int num_received = 0;
  ends.receiver.record_all(
      [&](const std::string& channel, std::int64_t utime, std::span<const std::uint8_t> bytes) {
        CHECK(utime > 0);
        recorded[channel].assign(bytes.begin(), bytes.end());
      });
  ends.receiver.subscribe<known_input_t>("INPUT", [&](const known_input_t&) { ++num_received; });
  known_input_t message = message_of(4.0);
  ends.sender.publish("INPUT", message);
  const auto hostile = hostile_length(-1);
  ends.sender.publish_bytes("FOREIGN|x", hostile.data(), hostile.size());
  REQUIRE(ends.wait_until([&] { return recorded.contains("FOREIGN|x"); }));
  CHECK(recorded["INPUT"] == testing::encoded(message));
  CHECK(recorded["FOREIGN|x"] == hostile);
  CHECK(num_received == 1);
}

TEST_CASE("over memq a handler may publish and subscribe") {
  LcmLink link("memq://");
  std::vector<std::int64_t> seqs;
  link.subscribe<known_input_t>("A", [&](const known_input_t& message) {
    known_input_t answer = message;
    link.publish("B", answer);
  });
  link.subscribe<known_input_t>("B",
                                [&](const known_input_t& message) { seqs.push_back(message.seq); });
  known_input_t message = message_of(0.0);
  for (int i = 0; i < 3; ++i) link.publish("A", message);
  link.handle_pending();
  CHECK(seqs == std::vector<std::int64_t>{0, 1, 2});
  CHECK(link.counters().lost == 0);
}

TEST_CASE("what cannot be sent, and where LCM cannot start, is told") {
  LcmLink link("udpm://239.255.76.67:20109?ttl=0");
  known_input_t message = message_of(0.0);
  CHECK_FALSE(link.publish(std::string(200, 'A'), message));
  CHECK(link.counters().publish_failures == 1);
  CHECK_THROWS_AS(LcmLink("nonsense://"), JobError);
}

TEST_CASE("a status carries state, remark and every counter") {
  Ends ends(20110);
  status_t last{};
  ends.receiver.subscribe<status_t>("STATUS_CAN_DRIVER",
                                    [&](const status_t& message) { last = message; });
  StatusReporter reporter(ends.sender, "can-driver");
  reporter.set_state(ProcessState::kRunning);
  reporter.set_step(12);
  reporter.counter("frames") = 5;
  reporter.remark("something happened");
  REQUIRE(ends.wait_until([&] { return last.step == 12; }));
  CHECK(last.name == "can-driver");
  CHECK(last.state == status_t::RUNNING);
  CHECK(last.remark == "something happened");
  REQUIRE(last.counter_name.size() == last.counter_value.size());
  CHECK(last.counter_name.at(0) == "frames");
  CHECK(last.counter_value.at(0) == 5);
  for (const char* name :
       {"lcm_received", "lcm_kernel_drops", "lcm_refused", "lcm_lost", "lcm_publish_failures"}) {
    CHECK(std::count(last.counter_name.begin(), last.counter_name.end(), name) == 1);
  }
}

}  // namespace holdfast
