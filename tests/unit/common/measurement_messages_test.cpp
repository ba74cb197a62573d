#include "common/measurement_messages.h"

#include <array>
#include <holdfast/measurement_set_t.hpp>

#include "tests/support/catch.h"
#include "tests/support/message_types.h"

namespace holdfast {
namespace {

MeasurementSet example() {
  MeasurementSet set;
  set.clear(7, 700'000);
  Packet packet;
  packet.source = 3;
  packet.rx_index = 41;
  packet.receive_utime = 123'456;
  packet.step_counter = 7;
  set.add(packet, std::array{1.0, -2.5});
  set.add(packet, std::array{1.0, -2.5});  // a duplicate stays a packet of its own
  packet.source = 0;
  packet.rx_index = 43;
  packet.step_counter = -1;
  set.add(packet, {});
  set.add(packet, std::array{0.1});
  return set;
}

void check_equal(const MeasurementSet& a, const MeasurementSet& b) {
  CHECK(a.step == b.step);
  CHECK(a.utime == b.utime);
  CHECK(a.values == b.values);
  REQUIRE(a.packets.size() == b.packets.size());
  for (std::size_t i = 0; i < a.packets.size(); ++i) {
    INFO("packet " << i);
    CHECK(a.packets[i].source == b.packets[i].source);
    CHECK(a.packets[i].rx_index == b.packets[i].rx_index);
    CHECK(a.packets[i].receive_utime == b.packets[i].receive_utime);
    CHECK(a.packets[i].step_counter == b.packets[i].step_counter);
    CHECK(a.packets[i].first_value == b.packets[i].first_value);
    CHECK(a.packets[i].num_values == b.packets[i].num_values);
  }
}

}  // namespace

TEST_CASE("a measurement set goes through its message unchanged, in arrival order") {
  const MeasurementSet set = example();
  measurement_set_t message{};
  message.seq = 12;
  to_message(set, message);
  CHECK(message.seq == 12);
  CHECK(message.num_packets == 4);
  const auto bytes = testing::encoded(message);
  measurement_set_t received;
  REQUIRE(received.decode(bytes.data(), 0, static_cast<int>(bytes.size())) > 0);
  MeasurementSet result;
  from_message(received, result);
  check_equal(result, set);
  CHECK(result.seq == 12);
}

TEST_CASE("nothing of an earlier step is left in a set or message that is used again") {
  measurement_set_t message{};
  MeasurementSet set = example();
  to_message(set, message);
  MeasurementSet result = example();
  set.clear(8, 800'000);
  to_message(set, message);
  CHECK(message.num_packets == 0);
  CHECK(message.packets.empty());
  from_message(message, result);
  check_equal(result, set);
}

}  // namespace holdfast
