#include <regex.h>

#include "common/errors.h"
#include "common/lcm_link.h"
#include "common/lcm_socket_filter.h"
#include "common/program.h"
#include "common/status.h"
#include "tests/support/catch.h"

namespace holdfast {

TEST_CASE("a channel's pattern matches that channel and no other") {
  for (const std::string channel :
       {"MEASUREMENT", "A.B", "A|B", "^A$", "(A)", "[A]", "A*", "A+", "A?", "A{1}", "A\\d"}) {
    regex_t pattern;
    INFO(channel);
    REQUIRE(regcomp(&pattern, ("^" + exact_channel_pattern(channel) + "$").c_str(), REG_EXTENDED) ==
            0);
    const auto matches = [&](const std::string& name) {
      return regexec(&pattern, name.c_str(), 0, nullptr, 0) == 0;
    };
    CHECK(matches(channel));
    for (const std::string other : {"AxB", "A", "B", "AA", "A1", "", "MEASUREMENTS"})
      CHECK_FALSE(matches(other));
    regfree(&pattern);
  }
}

TEST_CASE("an LCM URL gets a time to live of 0 and a buffer, unless it says otherwise") {
  CHECK(complete_lcm_url("udpm://239.1.2.3:7667", 100) ==
        "udpm://239.1.2.3:7667?ttl=0&recv_buf_size=100");
  CHECK(complete_lcm_url("udpm://239.1.2.3:7667?ttl=1", 100) ==
        "udpm://239.1.2.3:7667?ttl=1&recv_buf_size=100");
  CHECK(complete_lcm_url("udpm://239.1.2.3:7667?recv_buf_size=7&ttl=0", 100) ==
        "udpm://239.1.2.3:7667?recv_buf_size=7&ttl=0");
  CHECK(complete_lcm_url("memq://", 100) == "memq://");
  CHECK(complete_lcm_url("file://log.lcm", 100) == "file://log.lcm");
}

TEST_CASE("a URL's port is LCM's default where it names none") {
  CHECK(udpm_port("udpm://239.1.2.3:20101?ttl=0") == 20101);
  CHECK(udpm_port("udpm://239.1.2.3:20101") == 20101);
  CHECK(udpm_port("udpm://?ttl=0") == 7667);
  CHECK(udpm_port("udpm://") == 7667);
  CHECK(udpm_port("memq://") == 0);
}

TEST_CASE("a channel's name is made of capitals, digits and underscores") {
  CHECK(channel_name("EST_", "secure") == "EST_SECURE");
  CHECK(channel_name("STATUS_", "can-driver.2 x") == "STATUS_CAN_DRIVER_2_X");
  CHECK(channel_name("EST_", "a\n\xC3\xA9") == "EST_A___");
  CHECK(channel_name("EST_", "") == "EST_");
}

TEST_CASE("a program's exit status says what went wrong") {
  CHECK(run_program("test", [] { return 0; }) == 0);
  CHECK(run_program("test", [] { return 7; }) == 7);
  CHECK(run_program("test", []() -> int { throw UsageError("wrong use"); }) == 2);
  CHECK(run_program("test", []() -> int { throw JobError("did not work"); }) == 1);
  CHECK(run_program("test", []() -> int { throw std::runtime_error("unforeseen"); }) == 1);
}

}  // namespace holdfast
