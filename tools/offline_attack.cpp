#include "tools/offline_attack.h"

#include <array>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "common/errors.h"
#include "drivers/can/can_bus.h"
#include "drivers/can/candump_bus.h"
#include "drivers/can/candump_log.h"

namespace holdfast {
namespace {

using Json = nlohmann::ordered_json;

// As candump writes it, without time and interface; null where there is no frame.
Json frame_json(const CanFrame& frame, bool is_there) {
  if (!is_there) return nullptr;
  const std::string line = format_candump_line({0, "x", frame});
  return line.substr(line.rfind(' ') + 1);
}

// Of all rules that acted on it.
Json actions_json(const AttackRecord& record) {
  Json names = Json::array();
  for (int i = 0; i < 32; ++i) {
    const auto action = static_cast<AttackRule::Action>(i);
    if (record.acted(action)) names.push_back(to_string(action));
  }
  return names;
}

Json record_json(const AttackRecord& record, const std::vector<AttackRule>& rules) {
  const AttackRule& rule = rules[record.rule];
  const bool is_command = record.direction == AttackRecord::Direction::kToPlant;
  return {{"step", record.step},
          {"direction", is_command ? "to_plant" : "to_monitor"},
          {"disposition", to_string(record.disposition)},
          {"rule", rule.name},
          {"action", to_string(rule.action)},
          {"actions", actions_json(record)},
          {"class", rule.attack_class},
          {"rx_index", record.rx_index},
          {"tx_index", record.tx_index},
          {"draw_index", record.draw_index},
          {"draw", record.draw},
          {"saturated", record.is_saturated},
          {"original",
           frame_json(record.original, record.disposition != AttackRecord::Disposition::kInjected)},
          {"forwarded", frame_json(record.forwarded, record.tx_index >= 0)}};
}

std::unique_ptr<CandumpWriter> open_log(const std::string& file) {
  BusOptions options;
  options.may_write = true;
  auto log = std::make_unique<CandumpWriter>(file, options);
  log->keep_times();
  return log;
}

// Nothing is made before all can be.
void require_new(const OfflineAttack& files) {
  std::set<std::string> names;
  for (const std::string& file : {files.out, files.truth, files.commands}) {
    if (file.empty()) continue;
    if (std::filesystem::exists(file))
      throw UsageError(file + ": exists already; remove it or name another file");
    if (!names.insert(std::filesystem::absolute(file).lexically_normal().string()).second)
      throw UsageError(file + ": is named for two outputs");
  }
}

// The step that the recording's first tick ends; none when it has no tick of the scenario.
std::optional<std::int64_t> first_step_of(const std::string& file, const FrameLayout& layout) {
  CandumpReader log(file);
  const FrameCodec codec(layout);
  std::vector<double> values;
  std::array<CanFrame, 64> batch;
  std::int64_t num_frames = 0;
  while (!log.at_end()) {
    const std::size_t count = log.read(batch);
    num_frames += static_cast<std::int64_t>(count);
    for (std::size_t i = 0; i < count; ++i) {
      const FrameCodec::Decoded decoded = codec.decode(batch[i], values);
      values.clear();
      if (decoded.kind == FrameCodec::Kind::kTick && decoded.tick_step > 0)
        return decoded.tick_step;
    }
  }
  if (num_frames == 0)
    throw UsageError(file +
                     ": holds no frame in the format of candump -L, "
                     "(1700000000.000000) can0 123#DEADBEEF");
  return std::nullopt;
}

// The first tick that was not the one of its step: it, and all behind it, end none.
struct OddTick {
  std::int64_t expected = 0;
  CanFrame frame;
};

class TruthFile {
 public:
  explicit TruthFile(const std::string& file) : file_(file) {
    if (file.empty()) return;
    stream_.open(file, std::ios::binary);
    if (!stream_) throw JobError(file + ": cannot be made");
  }
  void write(const std::vector<AttackRecord>& records, const std::vector<AttackRule>& rules) {
    if (file_.empty()) return;
    for (const AttackRecord& record : records) stream_ << record_json(record, rules).dump() << '\n';
  }
  void finish() {
    if (!file_.empty() && !stream_.flush()) throw JobError(file_ + ": cannot be written");
  }

 private:
  std::string file_;
  std::ofstream stream_;
};

// What is forged has no stamp of its own.
void stamp(std::vector<CanFrame>& frames, std::int64_t time_ns) {
  for (CanFrame& frame : frames) {
    if (frame.receive_time_ns == 0) frame.receive_time_ns = time_ns;
  }
}

std::string summary(const ProxyCore& core, std::int64_t first_step, const BusCounters& in,
                    std::size_t num_commands, const std::optional<OddTick>& odd) {
  const ProxyCounters& c = core.counters();
  std::string text = "steps " + std::to_string(core.current_step() - first_step) +
                     "  frames read " + std::to_string(c.received) + "  passed " +
                     std::to_string(c.passed) + "  altered " + std::to_string(c.altered) +
                     "  dropped " + std::to_string(c.dropped) + "  injected " +
                     std::to_string(c.injected) + "  duplicated " + std::to_string(c.duplicated);
  // Only where rules delay: most do not.
  if (c.held > 0)
    text += "  held " + std::to_string(c.held) + "  released " + std::to_string(c.released);
  text += "  written " + std::to_string(c.sent) + '\n';
  if (core.num_held() > 0) {
    text += "warning: " + std::to_string(core.num_held()) +
            " frames were still held when the recording ended\n";
  }
  if (num_commands > 0) text += "commands forged " + std::to_string(num_commands) + '\n';
  if (in.refused + in.error_frames > 0) {
    text += "left out: " + std::to_string(in.refused) + " broken lines, " +
            std::to_string(in.error_frames) + " error frames\n";
  }
  if (core.current_step() == first_step)
    text += "no tick of the scenario was among the frames: all of them count as one step\n";
  if (odd) {
    text += "warning: " + std::to_string(c.odd_ticks) + " ticks ended no step, the first one " +
            std::string(frame_json(odd->frame, true)) + " where that of step " +
            std::to_string(odd->expected) + " was due: rules stayed in step " +
            std::to_string(core.current_step()) + "\n";
  }
  return text;
}

}  // namespace

std::string attack_offline(const Experiment& experiment, const OfflineAttack& files) {
  if (files.in.empty() || files.out.empty())
    throw UsageError("--in, a recording, needs --out, a new file, and the other way round");
  require_new(files);
  const std::optional<std::int64_t> found = first_step_of(files.in, experiment.layout);
  const std::int64_t first_step = found.value_or(1);
  const std::unique_ptr<CanBus> in = open_can_bus("candump:" + files.in);
  const auto out = open_log(files.out);
  const auto commands = files.commands.empty() ? nullptr : open_log(files.commands);
  TruthFile truth(files.truth);
  ProxyCore core = experiment.make_proxy(0);
  core.begin_at(first_step);
  std::optional<OddTick> odd;
  ProxyOutput output;
  std::array<CanFrame, 64> batch;
  std::size_t num_commands = 0;
  for (std::size_t count = batch.size(); count > 0;) {
    count = in->read(batch);
    for (std::size_t i = 0; i < count; ++i) {
      output.clear();
      const std::int64_t step = core.current_step();
      core.on_frame(batch[i], output);
      if (!odd && core.counters().odd_ticks > 0) odd = {step, batch[i]};
      if (files.is_dry) {
        output.frames.assign(1, batch[i]);
        output.commands.clear();
      }
      stamp(output.frames, batch[i].receive_time_ns);
      stamp(output.commands, batch[i].receive_time_ns);
      out->write(output.frames);
      if (commands) commands->write(output.commands);
      num_commands += output.commands.size();
      truth.write(output.records, core.rules());
      truth.write(output.command_records, core.rules());
    }
  }
  truth.finish();
  return summary(core, first_step, in->counters(), num_commands, odd);
}

}  // namespace holdfast
