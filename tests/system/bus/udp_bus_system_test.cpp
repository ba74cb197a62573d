// The UDP bus against python-can, against hostile senders and against a full queue. Runs in a
// network of its own, with loopback only and a multicast route to it.

#include "drivers/can/udp_bus.h"

#include <arpa/inet.h>
#include <sys/socket.h>

#include <cstdlib>
#include <sstream>

#include "common/errors.h"
#include "common/random_stream.h"
#include "drivers/can/udp_frame.h"
#include "tests/support/bus_reading.h"
#include "tests/support/catch.h"
#include "tests/support/child_process.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

const std::string kUrl = "udp:239.74.163.2:43113";

// Sends bytes as they are to the group, from a socket of its own.
class RawSender {
 public:
  RawSender() : socket_(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in group{};
    group.sin_family = AF_INET;
    group.sin_port = htons(43113);
    inet_pton(AF_INET, "239.74.163.2", &group.sin_addr);
    void* const place = &group;
    REQUIRE(connect(socket_.get(), static_cast<sockaddr*>(place), sizeof group) == 0);
  }
  void send_bytes(std::span<const std::uint8_t> bytes) const {
    REQUIRE(send(socket_.get(), bytes.data(), bytes.size(), 0) ==
            static_cast<ssize_t>(bytes.size()));
  }

 private:
  FileDescriptor socket_;
};

std::string line_of(const CanFrame& frame) {
  std::ostringstream line;
  line << frame.identifier << ' ' << frame.has(CanFrame::kExtended) << ' '
       << frame.has(CanFrame::kRemote) << ' ' << frame.has(CanFrame::kFd) << ' '
       << frame.has(CanFrame::kBitRateSwitch) << ' ' << frame.has(CanFrame::kErrorStateIndicator)
       << ' ' << int{frame.num_bytes} << ' ';
  for (const std::uint8_t byte : frame.bytes()) {
    const char* const kDigits = "0123456789abcdef";
    line << kDigits[byte >> 4] << kDigits[byte & 15];
  }
  if (frame.bytes().empty()) line << '-';
  return line.str();
}

}  // namespace

TEST_CASE("python-can reads our frames, and we read the same ones from it") {
  UdpBus bus(kUrl, writable());
  const auto frames = frames_of_every_kind();
  ChildProcess peer({HOLDFAST_SYSTEM_PYTHON,
                     HOLDFAST_SOURCE_DIR "/tests/system/bus/python_can_peer.py", "239.74.163.2",
                     "43113", std::to_string(frames.size())});
  REQUIRE(peer.read_line() == "ready");
  REQUIRE(bus.write(frames) == frames.size());
  for (const CanFrame& frame : frames) CHECK(peer.read_line() == line_of(frame));
  const auto answers = read_frames(bus, frames.size());
  REQUIRE(answers.size() == frames.size());
  const std::int64_t now_ns = wall_utime() * 1000;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    CHECK(answers[i].same_on_wire(frames[i]));
    CHECK(answers[i].receive_time_ns > now_ns - 60'000'000'000);
    CHECK(answers[i].receive_time_ns <= now_ns);
  }
  CHECK(peer.wait() == 0);
  CHECK(bus.counters().refused == 0);
  CHECK(bus.counters().kernel_dropped == 0);
}

TEST_CASE("each bus reads the others' frames in order, never its own") {
  UdpBus one(kUrl, writable()), two(kUrl, writable()), three(kUrl, {});
  constexpr std::uint32_t kNum = 1000;
  std::vector<CanFrame> frames;
  for (std::uint32_t i = 0; i < kNum; ++i) frames.push_back(numbered_frame(i));
  REQUIRE(one.write(frames) == kNum);
  for (UdpBus* bus : {&two, &three}) {
    const auto read = read_frames(*bus, kNum);
    REQUIRE(read.size() == kNum);
    for (std::uint32_t i = 0; i < kNum; ++i) {
      if (number_of(read[i]) != i) FAIL("frame " << number_of(read[i]) << " at place " << i);
    }
  }
  // The next foreign frame is the first thing that the writer itself hears.
  const CanFrame last = numbered_frame(77, 0x7A);
  REQUIRE(two.write(std::span(&last, 1)) == 1);
  const auto heard = read_frames(one, 1);
  REQUIRE(heard.size() == 1);
  CHECK(heard[0].same_on_wire(last));
  CHECK(one.counters().read == 1);
  CHECK_THROWS_AS(three.write(frames), std::logic_error);
}

TEST_CASE("hostile datagrams are refused and counted, genuine ones between them pass") {
  UdpBus bus(kUrl, {});
  const RawSender sender;
  const RandomStream random(1, 0, "udp_bus_system_test");
  std::vector<std::uint8_t> genuine(kUdpFrameBytesMax);
  genuine.resize(pack_udp_frame(numbered_frame(5), 1.0, genuine));
  constexpr int kNum = 300;
  for (std::uint32_t i = 0; i < kNum; ++i) {
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(random.uniform(i, 0) * 3000));
    for (std::size_t k = 0; k < bytes.size(); ++k) {
      bytes[k] = static_cast<std::uint8_t>(random.uniform(i, k + 1) * 256);
    }
    if (i % 3 == 0 && bytes.size() > 1) bytes[0] = 0x8B;
    sender.send_bytes(bytes);
    sender.send_bytes(genuine);
  }
  // A genuine map with bytes behind it that pass the receiver's buffer: cut, so refused.
  std::vector<std::uint8_t> padded = genuine;
  padded.resize(4000);
  sender.send_bytes(padded);
  sender.send_bytes(genuine);
  const auto frames = read_frames(bus, kNum + 1);
  REQUIRE(frames.size() == kNum + 1);
  for (const CanFrame& frame : frames) CHECK(number_of(frame) == 5);
  CHECK(bus.counters().refused == kNum + 1);
}

TEST_CASE("error frames are counted and not handed out") {
  UdpBus bus(kUrl, {});
  const RawSender sender;
  std::vector<std::uint8_t> bytes(kUdpFrameBytesMax);
  bytes.resize(pack_udp_frame(numbered_frame(5), 1.0, bytes));
  const std::string key = "is_error_frame";
  const auto place = std::search(bytes.begin(), bytes.end(), key.begin(), key.end());
  std::vector<std::uint8_t> error = bytes;
  error[static_cast<std::size_t>(place - bytes.begin()) + key.size()] = 0xC3;  // true
  sender.send_bytes(error);
  sender.send_bytes(bytes);
  CHECK(read_frames(bus, 1).size() == 1);
  CHECK(bus.counters().error_frames == 1);
  CHECK(bus.counters().refused == 0);
}

TEST_CASE("what a full queue lost is counted, the last frames too") {
  std::vector<std::string> events;
  BusOptions small;
  small.receive_buffer_bytes = 16384;
  small.on_event = [&](const std::string& event) { events.push_back(event); };
  UdpBus writer(kUrl, writable()), reader(kUrl, small);
  const std::vector<CanFrame> frames(2000, numbered_frame(1));
  REQUIRE(writer.write(frames) == frames.size());
  std::vector<CanFrame> read(frames.size());
  const std::size_t num_read = reader.read(read);
  CHECK(num_read > 0);
  CHECK(num_read < frames.size());
  CHECK(num_read + static_cast<std::size_t>(reader.counters().kernel_dropped) == frames.size());
  REQUIRE(events.size() == 1);
  CHECK(events[0].find("dropped") != std::string::npos);
  // Another group hears nothing of this one.
  UdpBus other("udp:239.74.163.3:43113", {});
  REQUIRE(writer.write(frames) == frames.size());
  CHECK(other.read(read) == 0);
  CHECK(other.counters().kernel_dropped == 0);
}

TEST_CASE("no route leads frames away from loopback") {
  REQUIRE(run_command({"ip", "route", "del", "224.0.0.0/4", "dev", "lo"}) == 0);
  // A network card beside loopback, with the route by which multicast usually leaves.
  REQUIRE(run_command({"ip", "link", "add", "card", "type", "veth", "peer", "name", "cable"}) == 0);
  for (const char* name : {"card", "cable"}) {
    REQUIRE(run_command({"ip", "link", "set", name, "up"}) == 0);
  }
  REQUIRE(run_command({"ip", "addr", "add", "10.9.8.7/24", "dev", "card"}) == 0);
  REQUIRE(run_command({"ip", "route", "add", "default", "dev", "card"}) == 0);
  const auto on_cable = [] {
    // IPv6 chatter of the kernel comes by here, so our frames are looked for by their content.
    return FileDescriptor(
        socket(AF_PACKET, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, htons(0x0800)));
  }();
  REQUIRE(on_cable.is_open());
  {
    UdpBus one(kUrl, writable()), two(kUrl, {});
    const CanFrame frame = numbered_frame(3);
    REQUIRE(one.write(std::span(&frame, 1)) == 1);
    CHECK(read_frames(two, 1).size() == 1);
    std::array<char, 2048> packet;
    sockaddr_storage from{};
    socklen_t size = sizeof from;
    void* const place = &from;
    int num_packets = 0;
    while (recvfrom(on_cable.get(), packet.data(), packet.size(), 0, static_cast<sockaddr*>(place),
                    &size) > 0) {
      ++num_packets;
      CHECK(static_cast<unsigned char>(packet[14 + 12]) == 127);  // source 127.x: on loopback
    }
    CHECK(num_packets > 0);  // the watch sees what there is
    // And what comes in from outside is not heard.
    CHECK(two.counters().refused == 0);
    const RawSender outside;  // by the default route
    outside.send_bytes(std::vector<std::uint8_t>(10));
    std::array<CanFrame, 4> none;
    CHECK(two.read(none) == 0);
    CHECK(two.counters().refused == 0);
  }
  REQUIRE(run_command({"ip", "link", "del", "card"}) == 0);
  REQUIRE(run_command({"ip", "route", "add", "224.0.0.0/4", "dev", "lo"}) == 0);
}

TEST_CASE("without loopback the bus says what is missing") {
  REQUIRE(run_command({"ip", "link", "set", "lo", "down"}) == 0);
  CHECK_THROWS_AS(UdpBus(kUrl, writable()), JobError);
  REQUIRE(run_command({"ip", "link", "set", "lo", "up"}) == 0);
  REQUIRE(run_command({"ip", "route", "add", "224.0.0.0/4", "dev", "lo"}) == 0);
}
