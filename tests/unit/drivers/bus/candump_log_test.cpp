#include "drivers/can/candump_log.h"

#include "tests/support/catch.h"

using holdfast::CandumpLine;
using holdfast::CandumpRecord;
using holdfast::CanFrame;

namespace {

CandumpRecord parse(const std::string& line) {
  CandumpRecord record;
  INFO(line);
  REQUIRE(parse_candump_line(line, record) == CandumpLine::kFrame);
  return record;
}

bool is_broken(const std::string& line) {
  CandumpRecord record;
  return parse_candump_line(line, record) == CandumpLine::kBroken;
}

}  // namespace

TEST_CASE("a classic line is read field by field") {
  const CandumpRecord record = parse("(1436509052.249713) vcan0 044#2A366C2BBA");
  CHECK(record.time_ns == 1436509052249713000);
  CHECK(record.interface_name == "vcan0");
  CHECK(record.frame.identifier == 0x44);
  CHECK(int{record.frame.flags} == 0);
  CHECK(int{record.frame.num_bytes} == 5);
  CHECK(int{record.frame.data[0]} == 0x2A);
  CHECK(int{record.frame.data[4]} == 0xBA);
  CHECK(record.frame.receive_time_ns == record.time_ns);
}

TEST_CASE("the fraction has six digits or nine, and their value counts") {
  CHECK(parse("(0000000000.500000) can0 1FF#").time_ns == 500'000'000);
  CHECK(parse("(0000000000.500000000) can0 1FF#").time_ns == 500'000'000);
  CHECK(parse("(0000000001.000000001) can0 1FF#").time_ns == 1'000'000'001);
  CHECK(is_broken("(0.5) can0 1FF#"));
  CHECK(is_broken("(0.5000000) can0 1FF#"));
  CHECK(is_broken("(-1.500000) can0 1FF#"));
  CHECK(is_broken("(9999999999.500000) can0 1FF#"));
}

TEST_CASE("a direction, dots and a raw length code are accepted") {
  CHECK(parse("(1.000000) can0 123#11 R").frame.num_bytes == 1);
  CHECK(parse("(1.000000) can0 123#11 T\r\n").frame.num_bytes == 1);
  CHECK(is_broken("(1.000000) can0 123#11 X"));
  CHECK(parse("(1.000000) can0 123#11.22.33").frame.num_bytes == 3);
  CHECK(parse("(1.000000) can0 123#1122334455667788_E").frame.num_bytes == 8);
  CHECK(is_broken("(1.000000) can0 123#11223344556677_E"));
  CHECK(is_broken("(1.000000) can0 123#1122334455667788_8"));
  CHECK(is_broken("(1.000000) can0 123#11."));
  CHECK(is_broken("(1.000000) can0 123#.11"));
}

TEST_CASE("the number of digits tells a short identifier from a long one") {
  CHECK_FALSE(parse("(1.000000) can0 123#").frame.has(CanFrame::kExtended));
  const CanFrame extended = parse("(1.000000) can0 00000123#").frame;
  CHECK(extended.has(CanFrame::kExtended));
  CHECK(extended.identifier == 0x123);
  CHECK(is_broken("(1.000000) can0 0123#"));
  CHECK(is_broken("(1.000000) can0 800#"));
  CHECK(is_broken("(1.000000) can0 80000123#"));
}

TEST_CASE("remote frames keep their length") {
  const CanFrame plain = parse("(1.000000) can0 123#R").frame;
  CHECK(plain.has(CanFrame::kRemote));
  CHECK(int{plain.num_bytes} == 0);
  CHECK(int{parse("(1.000000) can0 12345678#R5").frame.num_bytes} == 5);
  CHECK(int{parse("(1.000000) can0 123#R8_A").frame.num_bytes} == 8);
  CHECK(is_broken("(1.000000) can0 123#R9"));
}

TEST_CASE("FD frames: every flags nibble is accepted, the two wire flags are read") {
  const CanFrame old_form = parse("(1.000000) can0 123##1AA").frame;
  const CanFrame new_form = parse("(1.000000) can0 123##5AA").frame;
  CHECK(old_form.same_on_wire(new_form));
  CHECK(int{old_form.flags} == (CanFrame::kFd | CanFrame::kBitRateSwitch));
  CHECK(parse("(1.000000) can0 123##2").frame.has(CanFrame::kErrorStateIndicator));
  CHECK(is_broken("(1.000000) can0 123##"));
  CHECK(is_broken("(1.000000) can0 123##0112233445566778899"));  // nine bytes: no such FD length
  CHECK(int{parse("(1.000000) can0 123##0" + std::string(128, 'A')).frame.num_bytes} == 64);
  CHECK(is_broken("(1.000000) can0 123##0" + std::string(130, 'A')));
}

TEST_CASE("an error frame is never taken for data, whichever class it has") {
  const CanFrame bus_off = parse("(1.000000) can0 20000040#0000000000000000").frame;
  CHECK(bus_off.has(CanFrame::kError));
  CHECK_FALSE(bus_off.has(CanFrame::kExtended));
  CHECK(bus_off.identifier == 0x40);
  CHECK(is_broken("(1.000000) can0 20000040#00"));
  CHECK(is_broken("(1.000000) can0 20000040#R"));
}

TEST_CASE("comments are no broken lines") {
  CandumpRecord record;
  for (const char* line : {"", "\n", "DROPCOUNT: dropped 3 CAN frames", "# (1.0) can0"}) {
    CHECK(parse_candump_line(line, record) == CandumpLine::kComment);
  }
}

TEST_CASE("broken lines are refused and change nothing") {
  CandumpRecord record;
  record.interface_name = "kept";
  for (const char* line :
       {"(", "()", "(1.000000)", "(1.000000) ", "(1.000000) can0", "(1.000000) can0 ",
        "(1.000000) can0 123", "(1.000000) can0 12G#", "(1.000000) can0 123#1",
        "(1.000000) can0 123#1G", "(1.000000) can0 123#112233445566778899",
        "(1.000000) a_name_too_long_ 123#", "(1.000000)can0 123#", "(1.000000)  123#",
        "(1.000000) can0 #", "(1.000000) can0 123#11 R extra",
        "(1.000000) can0 45123#81:00:12345678#11.22"}) {  // the last one: CAN XL
    INFO(line);
    CHECK(parse_candump_line(line, record) == CandumpLine::kBroken);
    CHECK(record.interface_name == "kept");
  }
}

TEST_CASE("lines are written as candump writes them") {
  for (const char* line :
       {"(1436509052.249713) vcan0 044#2A366C2BBA", "(0000000000.000000) can1 7FF#",
        "(0000000001.000001) can1 00000001#FF", "(0000000001.000001) can1 123#R",
        "(0000000001.000001) can1 123#R8", "(0000000001.000001) can1 1FFFFFFF##3AABB",
        "(0000000001.000001) can1 123##0", "(0000000001.000001) can1 20000080#0001000000000000"}) {
    CHECK(format_candump_line(parse(line)) == line);
  }
  // Nanoseconds are rounded down, the newer flags nibble and the direction are left out.
  CHECK(format_candump_line(parse("(5.000000999) can1 123##5aa R")) ==
        "(0000000005.000000) can1 123##1AA");
}
