#include "tools/bus_inputs.h"

namespace holdfast {

BusInputs::BusInputs(const PlantSetup& plant, const FrameCodec& codec, bool checks_counter)
    : codec_(codec), checks_counter_(checks_counter) {
  const SystemSetup* system = plant.system();
  if (system == nullptr) return;
  const SystemModel& model = system->model();
  num_channels_ = model.num_attack_channels();
  for (int channel = 0; channel < num_channels_; ++channel) {
    if (!model.G.col(channel).isZero(0.0) || (model.H.col(channel).array() != 0.0).count() != 1)
      continue;
    for (std::size_t source = 0; source < system->rows.size(); ++source) {
      for (std::size_t value = 0; value < system->rows[source].size(); ++value) {
        const double gain = model.H(system->rows[source][value], channel);
        if (gain != 0.0) channels_.push_back({static_cast<int>(source), value, channel, gain});
      }
    }
  }
}

void BusInputs::add(std::int64_t step, const CanFrame& original, const CanFrame& forwarded,
                    std::span<double> attack) {
  before_.clear();
  after_.clear();
  const FrameCodec::Decoded before = codec_.decode(original, before_);
  const FrameCodec::Decoded after = codec_.decode(forwarded, after_);
  if (before.kind != FrameCodec::Kind::kReading || after.kind != FrameCodec::Kind::kReading ||
      before.packet.source != after.packet.source) {
    return;
  }
  if (checks_counter_ && !codec_.counter_matches(after.packet.step_counter, step)) return;
  for (const Channel& it : channels_) {
    if (it.source != before.packet.source) continue;
    attack[static_cast<std::size_t>(it.channel)] +=
        (after_[it.value] - before_[it.value]) / it.gain;
  }
}

}  // namespace holdfast
