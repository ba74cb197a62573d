#include "tools/live_look.h"

#include <array>
#include <iostream>
#include <memory>
#include <utility>

#include "common/clock.h"
#include "drivers/can/can_bus.h"
#include "drivers/event_loop.h"
#include "tools/bus_look.h"
#include "tools/dbc_tool.h"

namespace holdfast {

int look_at_bus(const std::string& bus_url, const std::string& dbc_file, double seconds) {
  BusLook bus_look(dbc_file.empty() ? Dbc{} : load_dbc(dbc_file));
  BusOptions bus_options;
  bus_options.wants_receive_times = true;
  const std::unique_ptr<CanBus> bus = open_can_bus(bus_url, bus_options);
  EventLoop loop;
  std::array<CanFrame, 64> batch;
  loop.watch_bus(*bus, [&] {
    for (std::size_t count = batch.size(); count == batch.size();) {
      count = bus->read(batch);
      for (std::size_t i = 0; i < count; ++i) {
        const std::int64_t stamp_ns = batch[i].receive_time_ns;
        bus_look.on_frame(batch[i], stamp_ns > 0 ? stamp_ns : monotonic_time_ns());
      }
    }
    if (bus->at_end()) loop.stop();
  });
  loop.on_stop_signal([&] { loop.stop(); });
  std::cerr << "looking for " << seconds << " s; Ctrl-C ends it" << std::endl;
  loop.run_for(seconds);
  std::cout << bus_look.text();
  const BusCounters& counters = bus->counters();
  const std::pair<const char*, std::int64_t> troubles[] = {
      {"error frames (is the bit rate right? is there a second node, and termination?)",
       counters.error_frames},
      {"frames or lines that are none", counters.refused},
      {"frames that the kernel dropped", counters.kernel_dropped}};
  for (const auto& [what, count] : troubles) {
    if (count > 0) std::cout << count << " " << what << '\n';
  }
  return bus_look.num_frames() > 0 ? 0 : 1;
}

}  // namespace holdfast
