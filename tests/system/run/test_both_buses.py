"""One seed over kernel CAN and over the UDP bus: the same estimates, log against log. Needs vcan0 and vcan1."""
import os
import unittest

import harness
from harness import RunTest, sets


class BothBusesTest(RunTest):
    def run_over(self, folder, sensor_bus, monitor_bus, *arguments, **options):
        run = harness.Run(self.path(folder), *sets(steps=40, period_s=0.02, network__sensor_bus=sensor_bus,
                                                   network__monitor_bus=monitor_bus), *arguments, **options)
        self.addCleanup(run.link.close)
        self.assert_succeeds(run.finish())
        self.assertEqual((run.sensor_bus, run.monitor_bus), (sensor_bus, monitor_bus))
        return run.log

    def test_kernel_can_and_udp_agree_to_the_bit(self):
        self.check()

    def test_breaker_frames_agree_to_the_bit(self):
        log = self.check("--set", "attacks=[{name: open, match: {messages: [BreakerCommand]}, window: {last_step: 2}, "
                         "action: inject, mode: '000', lead_steps: 18}]",
                         "--set", "network.commands=[{after_step: 8, mode: '111', lead_steps: 22}]",
                         scenario=os.path.join(harness.SOURCE, "scenarios", "three_area.yaml"))
        channels = [channel for channel, _ in harness.read_log(log)]
        self.assertEqual(channels.count("CAN_COMMAND"), 3)

    def check(self, *arguments, **options):
        over_can = self.run_over("can", "socketcan:vcan0", "socketcan:vcan1", *arguments, **options)
        over_udp = self.run_over("udp", "udp:239.74.163.2:44201", "udp:239.74.163.2:44202", *arguments, **options)
        self.assert_equal_runs(over_can, over_udp)
        return over_can


if __name__ == "__main__":
    unittest.main(verbosity=2)
