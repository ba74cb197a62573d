#include "drivers/can/udp_frame.h"

#include <cstring>
#include <string>
#include <vector>

#include "common/random_stream.h"
#include "tests/support/catch.h"

using holdfast::CanFrame;
using holdfast::unpack_udp_frame;
using Bytes = std::vector<std::uint8_t>;

namespace {

// msgpack written by hand, so that the test does not lean on the library that it tests.
Bytes text(const std::string& value) {
  Bytes bytes(1 + value.size(), static_cast<std::uint8_t>(0xA0 + value.size()));
  std::copy(value.begin(), value.end(), bytes.begin() + 1);
  return bytes;
}
Bytes number(int value) {
  return {0xCD, static_cast<std::uint8_t>(value >> 8), static_cast<std::uint8_t>(value)};
}
Bytes flag(bool value) {
  return {static_cast<std::uint8_t>(value ? 0xC3 : 0xC2)};
}
Bytes binary(const Bytes& data) {
  Bytes bytes(2 + data.size(), 0xC4);
  bytes[1] = static_cast<std::uint8_t>(data.size());
  std::copy(data.begin(), data.end(), bytes.begin() + 2);
  return bytes;
}
const Bytes kNil{0xC0};
const Bytes kHalfSecond{0xCB, 0x3F, 0xE0, 0, 0, 0, 0, 0, 0};

using Map = std::vector<std::pair<std::string, Bytes>>;

Map classic_map() {
  return {{"timestamp", kHalfSecond},
          {"arbitration_id", number(0x123)},
          {"is_extended_id", flag(false)},
          {"is_remote_frame", flag(false)},
          {"is_error_frame", flag(false)},
          {"channel", kNil},
          {"dlc", number(2)},
          {"data", binary({0xAB, 0xCD})},
          {"is_fd", flag(false)},
          {"bitrate_switch", flag(false)},
          {"error_state_indicator", flag(false)}};
}

Bytes& value_of(Map& map, const std::string& key) {
  for (auto& [name, value] : map) {
    if (name == key) return value;
  }
  throw std::logic_error("no such key: " + key);
}

Bytes encode(const Map& map) {
  Bytes bytes{0xDE, 0, static_cast<std::uint8_t>(map.size())};  // map 16
  for (const auto& [name, value] : map) {
    const Bytes key = text(name);
    bytes.insert(bytes.end(), key.begin(), key.end());
    bytes.insert(bytes.end(), value.begin(), value.end());
  }
  return bytes;
}

bool refused_with(const std::string& key, const Bytes& value) {
  Map map = classic_map();
  value_of(map, key) = value;
  return !unpack_udp_frame(encode(map));
}

}  // namespace

TEST_CASE("a datagram written by hand is read field by field") {
  const auto frame = unpack_udp_frame(encode(classic_map()));
  REQUIRE(frame);
  CHECK(frame->identifier == 0x123);
  CHECK(int{frame->flags} == 0);
  CHECK(int{frame->num_bytes} == 2);
  CHECK(int{frame->data[0]} == 0xAB);
  CHECK(int{frame->data[1]} == 0xCD);

  Map map = classic_map();
  value_of(map, "arbitration_id") = {0xCE, 0x1F, 0xFF, 0xFF, 0xFF};
  value_of(map, "is_extended_id") = flag(true);
  value_of(map, "channel") = text("vcan0");
  value_of(map, "dlc") = number(64);
  value_of(map, "data") = binary(Bytes(64, 7));
  value_of(map, "is_fd") = value_of(map, "bitrate_switch") = flag(true);
  std::reverse(map.begin(), map.end());  // any order of keys
  const auto fd = unpack_udp_frame(encode(map));
  REQUIRE(fd);
  CHECK(fd->identifier == 0x1FFFFFFF);
  CHECK(int{fd->flags} == (CanFrame::kExtended | CanFrame::kFd | CanFrame::kBitRateSwitch));
  CHECK(int{fd->data[63]} == 7);
}

TEST_CASE("packed bytes are those of the format") {
  CanFrame frame;
  frame.identifier = 0x23;
  frame.num_bytes = 1;
  frame.data[0] = 0xFE;
  Bytes bytes(holdfast::kUdpFrameBytesMax);
  bytes.resize(pack_udp_frame(frame, 0.5, bytes));
  Map map = classic_map();
  value_of(map, "arbitration_id") = {0x23};  // the shortest form of a small number
  value_of(map, "dlc") = {1};
  value_of(map, "data") = binary({0xFE});
  Bytes expected = encode(map);
  expected.erase(expected.begin(), expected.begin() + 3);
  expected.insert(expected.begin(), 0x8B);  // a map of 11 in one byte
  CHECK(bytes == expected);
}

TEST_CASE("every valid frame comes back from its datagram") {
  Bytes bytes(holdfast::kUdpFrameBytesMax);
  std::size_t longest = 0;
  for (int flags = 0; flags < 64; ++flags) {
    for (int length = 0; length <= 64; ++length) {
      CanFrame frame;
      frame.flags = static_cast<std::uint8_t>(flags);
      frame.identifier = frame.has(CanFrame::kExtended) ? 0x1FFFFFFF : 0x7FF;
      frame.num_bytes = static_cast<std::uint8_t>(length);
      for (std::size_t i = 0; i < frame.bytes().size(); ++i) {
        frame.data[i] = static_cast<std::uint8_t>(255 - i);
      }
      const std::size_t size = pack_udp_frame(frame, 1.7e9, bytes);
      if (!is_valid(frame) || frame.has(CanFrame::kError)) {
        CHECK(size == 0);
        continue;
      }
      longest = std::max(longest, size);
      const auto back = unpack_udp_frame(std::span(bytes).first(size));
      REQUIRE(back);
      CHECK(back->same_on_wire(frame));
    }
  }
  CHECK(longest < holdfast::kUdpFrameBytesMax / 2);  // room for a channel name, which others send
}

TEST_CASE("a map that is not exactly a frame is refused") {
  Map missing = classic_map();
  missing.pop_back();
  CHECK_FALSE(unpack_udp_frame(encode(missing)));
  Map unknown = classic_map();
  unknown.back().first = "something_else";
  CHECK_FALSE(unpack_udp_frame(encode(unknown)));
  Map twice = classic_map();
  twice.back() = twice.front();
  CHECK_FALSE(unpack_udp_frame(encode(twice)));
  Map more = classic_map();
  more.emplace_back("is_rx", flag(true));
  CHECK_FALSE(unpack_udp_frame(encode(more)));
  Bytes behind = encode(classic_map());
  behind.push_back(0xC0);
  CHECK_FALSE(unpack_udp_frame(behind));
  CHECK_FALSE(unpack_udp_frame(Bytes{}));
  CHECK_FALSE(unpack_udp_frame(Bytes{0x80}));  // an empty map
  CHECK_FALSE(unpack_udp_frame(kNil));
}

TEST_CASE("values of a wrong type or out of range are refused") {
  const Bytes nested_map{0x81, 0xA1, 'a', 0xC0}, empty_map{0x80}, array{0x91, 1}, ext{0xD4, 1, 1};
  for (const auto& [key, value] : classic_map()) {
    INFO(key);
    CHECK(refused_with(key, nested_map));
    CHECK(refused_with(key, empty_map));
    CHECK(refused_with(key, array));
    CHECK(refused_with(key, ext));
    if (key != "channel") CHECK(refused_with(key, text("text")));
    if (key != "channel") CHECK(refused_with(key, kNil));
    if (key != "data") CHECK(refused_with(key, binary({1, 2})));
  }
  CHECK(refused_with("arbitration_id", number(0x800)));
  CHECK(refused_with("arbitration_id", {0xCE, 0x20, 0, 0, 0}));
  CHECK(refused_with("arbitration_id", {0xCF, 1, 0, 0, 0, 0, 0, 1, 0x23}));
  CHECK(refused_with("arbitration_id", {0xFF}));  // -1
  CHECK(refused_with("dlc", number(3)));
  CHECK(refused_with("dlc", number(1)));
  CHECK(refused_with("dlc", {0xFF}));
  CHECK(refused_with("dlc", {0xCF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 2}));
  CHECK(refused_with("is_fd", number(1)));
  CHECK(refused_with("is_remote_frame", flag(true)));   // carries data
  CHECK(refused_with("bitrate_switch", flag(true)));    // without FD
  CHECK_FALSE(refused_with("channel", text("vcan0")));  // the negative control
}

TEST_CASE("lengths that lie are refused, in front of nothing or of everything") {
  const std::vector<Bytes> heads = {{0xDF, 0xFF, 0xFF, 0xFF, 0xFF},
                                    {0xDF, 0x80, 0, 0, 0},
                                    {0xDE, 0xFF, 0xFF},
                                    {0xDD, 0xFF, 0xFF, 0xFF, 0xFF},
                                    {0xDB, 0xFF, 0xFF, 0xFF, 0xFF},
                                    {0xC6, 0xFF, 0xFF, 0xFF, 0xFF},
                                    {0xC9, 0xFF, 0xFF, 0xFF, 0xFF, 1},
                                    {0xC1}};
  for (const Bytes& head : heads) {
    CHECK_FALSE(unpack_udp_frame(head));
    Bytes bytes = head;
    const Bytes rest = encode(classic_map());
    bytes.insert(bytes.end(), rest.begin(), rest.end());
    CHECK_FALSE(unpack_udp_frame(bytes));
    CHECK(refused_with("data", head));
  }
  CHECK_FALSE(unpack_udp_frame(Bytes(10000, 0x91)));  // ten thousand arrays, one in the other
  CHECK_FALSE(unpack_udp_frame(Bytes(10000, 0x81)));
}

TEST_CASE("every datagram cut short is refused") {
  const Bytes whole = encode(classic_map());
  for (std::size_t size = 0; size < whole.size(); ++size) {
    CHECK_FALSE(unpack_udp_frame(std::span(whole).first(size)));
  }
}

TEST_CASE("random and randomly damaged datagrams give a valid frame or none") {
  const holdfast::RandomStream random(1, 0, "udp_frame_test");
  const Bytes whole = encode(classic_map());
  int num_frames = 0, num_refused = 0;
  for (std::uint32_t round = 0; round < 100'000; ++round) {
    std::uint64_t draw = 0;
    const auto below = [&](std::size_t limit) {
      return static_cast<std::size_t>(random.uniform(round, draw++) * static_cast<double>(limit));
    };
    Bytes bytes = whole;
    if (round % 2 == 0) {
      bytes.resize(below(64));
      for (auto& byte : bytes) byte = static_cast<std::uint8_t>(below(256));
      if (!bytes.empty() && round % 4 == 0) bytes[0] = 0x8B;
    } else {
      for (std::size_t hits = 1 + below(3); hits > 0; --hits) {
        bytes[below(bytes.size())] = static_cast<std::uint8_t>(below(256));
      }
    }
    const auto frame = unpack_udp_frame(bytes);
    if (frame) {
      ++num_frames;
      if (!is_valid(*frame)) FAIL("a frame that no bus carries");
    } else {
      ++num_refused;
    }
  }
  // Negative control: damage to data bytes or the time stamp does give frames, all else is refused.
  CHECK(num_frames > 1000);
  CHECK(num_refused > 50'000);
}
