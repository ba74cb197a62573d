// libFuzzer target: what the driver makes of any sequence of frames, over several layouts. Every
// frame counts once, what goes into a set is finite, what is written again reads the same, and what
// simulated sensors send is taken, whatever else was on the bus.

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "drivers/measurement_assembler.h"
#include "tests/fuzz/support.h"

namespace holdfast {
namespace {

using fuzzing::must;

class Bench {
 public:
  explicit Bench(const std::string& name)
      : layout_(fuzzing::layout_of(name)),
        codec_(layout_),
        readings_(layout_.messages.size(), std::vector<double>(1)) {}

  void run(fuzzing::Input input) {
    AssemblerOptions options;
    const std::uint8_t mode = input.take<std::uint8_t>();
    options.check_counter = (mode & 1U) != 0;
    options.closed_by_tick = (mode & 2U) != 0;
    options.num_steps = mode >> 4U;
    MeasurementAssembler assembler(codec_, options);
    std::optional<SensorTwins> twins = codec_.make_sensor_twins();
    while (!input.is_empty()) {
      switch (input.below(5)) {
        case 0:
          check_set(assembler, assembler.on_frame(input.take_frame()), twins);
          break;
        case 1:
          check_set(assembler, assembler.on_frame(take_message(input)), twins);
          break;
        case 2:
          if (!options.closed_by_tick) check_set(assembler, assembler.close_step(), twins);
          check_set(assembler, assembler.on_frame(codec_.encode_tick(assembler.current_step())),
                    twins);
          break;
        case 3:
          twins ? step_twins(input, assembler, *twins) : send_reading(input, assembler);
          break;
        default:
          if (twins) twins->on_frame(input.take_frame());
          break;
      }
      check_counters(assembler.counters());
    }
  }

 private:
  void check_counters(const AssemblerCounters& c) const {
    const std::int64_t taken = layout_.sensors.exist() ? c.sensor_frames : c.packets;
    must(c.frames == taken + c.unknown + c.wrong_format + c.non_finite + c.wrong_checksum +
                         c.wrong_counter + c.ticks + c.odd_ticks + c.after_end);
    must(c.ticks <= c.sets);
  }

  void check_set(const MeasurementAssembler& assembler, const MeasurementSet* set,
                 std::optional<SensorTwins>& twins) const {
    if (set == nullptr) return;
    must(set->step == assembler.current_step() - 1 && set->seq == assembler.counters().sets - 1);
    std::size_t num_values = 0;
    for (const Packet& packet : set->packets) {
      must(packet.source >= 0 && packet.source < static_cast<int>(layout_.messages.size()));
      must(packet.rx_index >= 0 && packet.rx_index < assembler.counters().frames);
      must(packet.first_value == num_values && packet.num_values == layout_.signals.size());
      num_values += packet.num_values;
    }
    must(num_values == set->values.size());
    for (const double value : set->values) must(std::isfinite(value));
    if (!twins) return;
    must(set->packets.size() + set->invalid.size() == layout_.messages.size());
    for (const CanFrame& frame : assembler.to_sensors()) {
      must(is_valid(frame) && is_for_sensors(layout_.sensors, frame));
      twins->on_frame(frame);
    }
  }

  // A frame of some message with other bytes, as it may come from its sender.
  CanFrame take_message(fuzzing::Input& input) const {
    const auto& messages = layout_.dbc.messages;
    CanFrame frame = messages[input.below(messages.size())].empty_frame();
    std::ranges::copy(input.take_bytes(frame.num_bytes), frame.data.begin());
    for (const FrameProtection& it : layout_.protection) {
      if (layout_.dbc.find(it.message)->matches(frame) && input.below(4) != 0)
        it.seal({frame.data.data(), frame.num_bytes});
    }
    std::vector<double> values = {0.5};
    const FrameCodec::Decoded decoded = codec_.decode(frame, values);
    if (decoded.kind == FrameCodec::Kind::kReading) {
      check_again(decoded.packet, {values.begin() + 1, values.end()});
    } else {
      must(values.size() == 1);
    }
    return frame;
  }

  // The layouts' signals have no more digits than a double, so that what was read is what is said.
  void check_again(const Packet& packet, const std::vector<double>& values) const {
    must(packet.first_value == 1 && packet.num_values == values.size());
    std::vector<double> again;
    const CanFrame frame = codec_.encode(packet.source, values, packet.step_counter);
    const FrameCodec::Decoded decoded = codec_.decode(frame, again);
    must(decoded.kind == FrameCodec::Kind::kReading && again == values);
    must(decoded.packet.source == packet.source);
    must(decoded.packet.step_counter == packet.step_counter);
  }

  void send_reading(fuzzing::Input& input, MeasurementAssembler& assembler) const {
    std::vector<double> values(layout_.signals.size());
    const auto source = static_cast<int>(input.below(codec_.num_sources()));
    for (double& value : values) value = input.take<float>();
    const std::int64_t before = assembler.counters().packets;
    const std::int64_t dropped = assembler.counters().non_finite + assembler.counters().after_end;
    assembler.on_frame(codec_.encode(source, values, assembler.current_step()));
    const AssemblerCounters& after = assembler.counters();
    must(after.packets + after.non_finite + after.after_end == before + dropped + 1);
  }

  void step_twins(fuzzing::Input& input, MeasurementAssembler& assembler, SensorTwins& twins) {
    const auto bits = input.take<std::uint16_t>();
    for (std::size_t i = 0; i < readings_.size(); ++i) readings_[i][0] = bits >> (i % 16) & 1;
    frames_.clear();
    twins.step(assembler.current_step(), readings_, frames_);
    const std::int64_t before = assembler.counters().sensor_frames + assembler.counters().after_end;
    for (const CanFrame& frame : frames_) {
      must(is_valid(frame));
      assembler.on_frame(frame);
    }
    must(assembler.counters().sensor_frames + assembler.counters().after_end ==
         before + static_cast<std::int64_t>(frames_.size()));
  }

  FrameLayout layout_;
  FrameCodec codec_;
  std::vector<std::vector<double>> readings_;
  std::vector<CanFrame> frames_;
};

}  // namespace
}  // namespace holdfast

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace holdfast;
  static std::array<Bench, 4> benches = {Bench("plain"), Bench("canopen"), Bench("j1939"),
                                         Bench("groups")};
  fuzzing::Input input(data, size);
  benches[input.below(benches.size())].run(input);
  return 0;
}
