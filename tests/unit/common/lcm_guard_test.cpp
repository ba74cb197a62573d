#include "common/lcm_guard.h"

#include <fstream>
#include <iomanip>
#include <limits>
#include <map>
#include <sstream>

#include "common/lcm_link.h"
#include "common/random_stream.h"
#include "tests/support/catch.h"
#include "tests/support/message_types.h"
#include "tests/support/wire_sample.h"

namespace holdfast {
namespace {

using testing::encoded;
using testing::for_each_message_type;
using testing::wire_sample;
using testing::WireSample;

template <class Message>
GuardVerdict check(const std::vector<std::uint8_t>& bytes) {
  return check_wire(*layouts::of<Message>, Message::getHash(), bytes);
}

template <class Message>
WireSample sample_of(int num_elements) {
  return wire_sample(*layouts::of<Message>, Message::getHash(), num_elements);
}

}  // namespace

TEST_CASE("the layout of each type is the one of its generated code") {
  for_each_message_type([]<class Message>() {
    INFO(Message::getTypeName());
    CHECK(std::string(layouts::of<Message>->name) == Message::getTypeName());
    for (const int num_elements : {0, 1, 3}) {
      const WireSample sample = sample_of<Message>(num_elements);
      REQUIRE(check<Message>(sample.bytes) == GuardVerdict::kOk);
      Message message;
      const int size = static_cast<int>(sample.bytes.size());
      REQUIRE(message.decode(sample.bytes.data(), 0, size) == size);
      CHECK(encoded(message) == sample.bytes);
    }
  });
}

TEST_CASE("bytes written by hand are accepted, and what they say is decoded") {
  const std::int64_t hash = known_input_t::getHash();
  WireSample sample;
  sample.put(static_cast<std::uint64_t>(hash), 8);
  sample.put(1'000'000, 8);            // utime
  sample.put(4, 8);                    // seq
  sample.put(5, 8);                    // step
  sample.put(2, 4);                    // num_inputs
  sample.put(0x3FF8000000000000U, 8);  // 1.5
  sample.put(0xC000000000000000U, 8);  // -2
  known_input_t message;
  REQUIRE(decode_guarded(sample.bytes, message));
  CHECK(message.utime == 1'000'000);
  CHECK(message.seq == 4);
  CHECK(message.step == 5);
  CHECK(message.input == std::vector<double>{1.5, -2.0});
}

TEST_CASE("every truncation is refused, and so is a byte too many") {
  for_each_message_type([]<class Message>() {
    INFO(Message::getTypeName());
    const std::vector<std::uint8_t> whole = sample_of<Message>(2).bytes;
    for (std::size_t size = 0; size < whole.size(); ++size) {
      INFO("cut to " << size << " of " << whole.size());
      const std::vector<std::uint8_t> cut(whole.begin(),
                                          whole.begin() + static_cast<std::ptrdiff_t>(size));
      const GuardVerdict verdict = check<Message>(cut);
      REQUIRE(verdict != GuardVerdict::kOk);
      if (size < 8) REQUIRE(verdict == GuardVerdict::kTooShort);
    }
    std::vector<std::uint8_t> longer = whole;
    longer.push_back(0);
    CHECK(check<Message>(longer) == GuardVerdict::kTrailingBytes);
  });
}

TEST_CASE("no hostile length of an array passes") {
  // 536870912 * 8 and 0x20000001 * 8 overflow 32 bits to 0 and to 8.
  const std::int32_t hostile[] = {
      -1,         std::numeric_limits<std::int32_t>::min(), 2'000'000'000, 536'870'912,
      0x20000001, std::numeric_limits<std::int32_t>::max()};
  int num_lengths = 0;
  for_each_message_type([&]<class Message>() {
    INFO(Message::getTypeName());
    for (const std::size_t offset : sample_of<Message>(2).array_lengths) {
      ++num_lengths;
      for (const std::int32_t length : hostile) {
        INFO("length " << length << " at byte " << offset);
        WireSample sample = sample_of<Message>(2);
        sample.overwrite_int32(offset, length);
        CHECK(check<Message>(sample.bytes) == GuardVerdict::kBadLength);
      }
    }
  });
  CHECK(num_lengths >= 16);
}

TEST_CASE("no hostile string passes") {
  int num_strings = 0;
  for_each_message_type([&]<class Message>() {
    INFO(Message::getTypeName());
    for (const std::size_t offset : sample_of<Message>(1).string_lengths) {
      ++num_strings;
      const auto verdict_with = [&](auto change) {
        WireSample sample = sample_of<Message>(1);
        const auto last = offset + 3 + sample.bytes[offset + 3];
        change(sample, last);
        return check<Message>(sample.bytes);
      };
      for (const std::int32_t length :
           {0, -1, 2'000'000'000, std::numeric_limits<std::int32_t>::min()}) {
        CHECK(verdict_with([&](WireSample& sample, std::size_t) {
                sample.overwrite_int32(offset, length);
              }) == GuardVerdict::kBadString);
      }
      // No NUL at the end; one in the middle.
      CHECK(verdict_with([](WireSample& sample, std::size_t last) { sample.bytes[last] = 'x'; }) ==
            GuardVerdict::kBadString);
      CHECK(verdict_with([](WireSample& sample, std::size_t last) {
              sample.bytes[last - 1] = 0;
            }) == GuardVerdict::kBadString);
    }
  });
  CHECK(num_strings >= 8);
}

TEST_CASE("one type's message is refused as any other's") {
  for_each_message_type([]<class Sent>() {
    const std::vector<std::uint8_t> bytes = sample_of<Sent>(1).bytes;
    for_each_message_type([&]<class Expected>() {
      INFO(Sent::getTypeName() << " taken for " << Expected::getTypeName());
      const bool is_same = Sent::getHash() == Expected::getHash();
      CHECK((check<Expected>(bytes) == GuardVerdict::kOk) == is_same);
    });
  });
}

TEST_CASE("whatever passes the guard decodes, and encodes to the same bytes") {
  const RandomStream random(1, 0, "guard mutations");
  constexpr std::uint32_t kMutationsPerType = 4000;
  for_each_message_type([&]<class Message>() {
    INFO(Message::getTypeName());
    std::uint32_t num_passed = 0;
    for (std::uint32_t mutation = 0; mutation < kMutationsPerType; ++mutation) {
      std::uint64_t draw = 0;
      const auto below = [&](std::size_t bound) {
        return static_cast<std::size_t>(random.uniform(mutation, draw++) *
                                        static_cast<double>(bound));
      };
      std::vector<std::uint8_t> bytes = sample_of<Message>(static_cast<int>(below(4))).bytes;
      for (std::size_t change = below(3) + 1; change > 0; --change) {
        const std::size_t at = below(bytes.size());
        switch (below(4)) {
          case 0:
            bytes[at] = static_cast<std::uint8_t>(below(256));
            break;
          case 1:
            bytes[at] = static_cast<std::uint8_t>(bytes[at] + 1);
            break;
          case 2:
            bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(at), 8, 0);
            break;
          default:
            bytes.resize(std::max<std::size_t>(at, 8));
            break;
        }
      }
      if (check<Message>(bytes) != GuardVerdict::kOk) continue;
      ++num_passed;
      Message message;
      const int size = static_cast<int>(bytes.size());
      REQUIRE(message.decode(bytes.data(), 0, size) == size);
      REQUIRE(encoded(message) == bytes);
    }
    // Else the loop would prove nothing about the decoder.
    CHECK(num_passed > kMutationsPerType / 100);
    CHECK(num_passed < kMutationsPerType);
  });
}

TEST_CASE("fingerprints are unique, and the ones that logs were written with") {
  const std::string file = HOLDFAST_SOURCE_DIR "/tests/unit/common/fingerprints.txt";
  std::ostringstream table;
  std::map<std::int64_t, std::string> seen;
  for_each_message_type([&]<class Message>() {
    const std::int64_t hash = Message::getHash();
    INFO(Message::getTypeName() << " and " << seen[hash]);
    CHECK(seen[hash].empty());
    seen[hash] = Message::getTypeName();
    table << Message::getTypeName() << " " << std::hex << std::setw(16) << std::setfill('0')
          << static_cast<std::uint64_t>(hash) << std::dec << "\n";
  });
  std::ostringstream expected;
  expected << std::ifstream(file).rdbuf();
  INFO(
      "A changed fingerprint makes old logs unreadable: give the changed type a new name. The "
      "table now:\n"
      << table.str());
  CHECK(table.str() == expected.str());
}

}  // namespace holdfast
