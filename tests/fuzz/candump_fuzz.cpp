// libFuzzer target: each frame that a line of a candump log holds is written and read again as it
// was, but for what microseconds cannot say; and so is any other frame.

#include "drivers/can/candump_log.h"

#include <algorithm>

#include "tests/fuzz/support.h"

namespace holdfast {
namespace {

using fuzzing::must;

void check_record(const CandumpRecord& record) {
  must(is_valid(record.frame) && record.time_ns >= 0);
  const std::string line = format_candump_line(record);
  CandumpRecord again;
  must(parse_candump_line(line, again) == CandumpLine::kFrame);
  must(again.time_ns == record.time_ns / 1000 * 1000);
  must(again.interface_name == record.interface_name);
  must(again.frame.same_on_wire(record.frame));
  must(again.frame.receive_time_ns == again.time_ns);
  must(format_candump_line(again) == line);
}

void check_line(std::string_view line) {
  CandumpRecord record;
  record.interface_name = "unchanged";
  if (parse_candump_line(line, record) == CandumpLine::kFrame) {
    must(record.frame.receive_time_ns == record.time_ns);
    check_record(record);
  } else {
    must(record.interface_name == "unchanged" && record.frame.same_on_wire(CanFrame()));
  }
}

}  // namespace
}  // namespace holdfast

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace holdfast;
  std::string_view text = fuzzing::text_of(data, size);
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size() - 1);
    check_line(text.substr(0, end + 1));
    text.remove_prefix(end + 1);
  }
  fuzzing::Input input(data, size);
  const std::int64_t time_ns = std::int64_t{input.take<std::uint32_t>()} * 1'000'001'000;
  check_record({time_ns, "can0", input.take_frame()});
  return 0;
}
