#include "common/errors.h"
#include "drivers/can/can_bus.h"
#include "tests/support/catch.h"

using Catch::Matchers::Contains;
using holdfast::open_can_bus;
using holdfast::UsageError;

TEST_CASE("a URL that is no bus is told with what would be one") {
  for (const char* url :
       {"", "vcan0", "socketcan:", "udp:", "candump:", "can:vcan0", "socketcan:a name",
        "socketcan:sixteen_letters_", "udp:239.74.163.2", "udp:239.74.163.2:", "udp:239.74.163.2:0",
        "udp:239.74.163.2:65536", "udp:239.74.163.2:80x", "udp:somewhere:43113",
        "udp:127.0.0.1:43113", "udp:192.168.1.4:43113", "candump:/no/such/file"}) {
    INFO(url);
    CHECK_THROWS_AS(open_can_bus(url), UsageError);
  }
}

TEST_CASE("groups that others use need the user's word") {
  CHECK_THROWS_WITH(open_can_bus("udp:224.0.0.251:5353"),
                    Contains("--i-own-this-bus udp:224.0.0.251:5353"));
}

TEST_CASE("what is not there is no virtual CAN interface, nor is loopback") {
  CHECK_FALSE(holdfast::is_virtual_can("no_such_bus"));
  CHECK_FALSE(holdfast::is_virtual_can(""));
  CHECK_FALSE(holdfast::is_virtual_can("a_name_that_is_much_too_long_for_an_interface"));
  CHECK_FALSE(holdfast::is_virtual_can("lo"));
}
