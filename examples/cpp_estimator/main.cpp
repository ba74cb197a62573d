// An estimator from outside, by find_package(holdfast): the target is where the sensors saw it
// last. usage: last_seen LCM_URL NAME SCENARIO
#include <common/configuration.h>
#include <common/status.h>
#include <drivers/event_loop.h>

#include <holdfast/estimate_t.hpp>
#include <holdfast/measurement_set_t.hpp>

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  const YAML::Node scenario = YAML::LoadFile(argv[3]);
  const YAML::Node sensors = scenario["plant"]["model"]["sensor_positions_m"];
  holdfast::LcmLink link(argv[1]);
  holdfast::StatusReporter status(link, argv[2]);
  holdfast::EventLoop loop;
  holdfast::estimate_t estimate{};
  estimate.attack_probability = estimate.input_step = -1;
  estimate.num_states = 4;
  estimate.mean.assign(4, 0.0);
  link.subscribe<holdfast::measurement_set_t>(
      "MEASUREMENT", [&](const holdfast::measurement_set_t& set) {
        double x = 0.0, y = 0.0, count = 0.0;
        for (const holdfast::packet_t& packet : set.packets) {
          if (packet.num_values != 1 || packet.values[0] < 0.25) continue;
          const YAML::Node position = sensors[static_cast<std::size_t>(packet.source)];
          x += position[0].as<double>(), y += position[1].as<double>(), count += 1.0;
        }
        if (count > 0.0) estimate.mean = {x / count, 0.0, y / count, 0.0};
        estimate.step = set.step;
        estimate.utime = set.utime;
        link.publish(holdfast::channel_name("EST_", argv[2]), estimate);
        if (set.step >= scenario["steps"].as<std::int64_t>()) loop.stop();
      });
  loop.watch(link.file_descriptor(), [&] { link.handle_pending(); });
  loop.every(0.25, [&] { status.publish(); });
  status.set_state(holdfast::ProcessState::kReady);
  status.publish();
  loop.run();
}
