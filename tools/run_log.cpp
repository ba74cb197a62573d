#include "tools/run_log.h"

#include <cmath>
#include <holdfast/attack_frame_t.hpp>
#include <holdfast/attack_signal_t.hpp>
#include <holdfast/can_frames_t.hpp>
#include <holdfast/estimate_t.hpp>
#include <holdfast/known_input_t.hpp>
#include <holdfast/measurement_set_t.hpp>
#include <holdfast/run_meta_t.hpp>
#include <holdfast/truth_t.hpp>

#include "attacker/attack_messages.h"
#include "common/log_file.h"
#include "common/measurement_messages.h"
#include "common/run_meta.h"
#include "common/status.h"
#include "drivers/can/can_messages.h"
#include "drivers/can/command_codec.h"
#include "estimators/estimate_messages.h"
#include "estimators/smoothed_stream.h"
#include "plant/truth_messages.h"
#include "tools/simulation.h"

namespace holdfast {
namespace {

class RunLog {
 public:
  RunLog(const Experiment& experiment, LogWriter& writer, Simulation& simulation)
      : experiment_(experiment), writer_(writer), command_codec_(experiment.layout) {
    frames_.bus = command_.bus = "loop:";
    for (std::size_t i = 0; i < simulation.entries().size(); ++i) {
      const EstimatorEntry& entry = *simulation.entries()[i];
      if (!entry.is_smoothed) continue;
      auto& estimator = dynamic_cast<SmoothingEstimator&>(simulation.estimator(i));
      smoothed_.push_back({channel_name("SMOOTHED_", entry.name),
                           SmoothedStream(estimator, static_cast<std::size_t>(entry.lag_steps))});
    }
  }

  void write(const Simulation& simulation) {
    const std::int64_t utime = utime_ = simulation.measurements().utime;
    to_message(simulation.truth(), utime, truth_);
    writer_.write_message("PLANT_TRUTH", utime, truth_);
    for (const AttackSignal& signal : simulation.truth().attack_signals) {
      to_message(signal, simulation.truth().step, utime, signal_);
      writer_.write_message("ATTACK_SIGNAL", utime, signal_);
    }
    for (const RuleSignal& signal : simulation.rule_signals()) {
      to_message(signal, experiment_.rules, experiment_.step_s(), signal_);
      writer_.write_message("ATTACK_SIGNAL", utime, signal_, "attacker");
    }
    write_known_input(simulation.truth().step);
    write_records(simulation.attack_records());
    write_records(simulation.command_records());
    if (experiment_.record_frames) write_commands(simulation.commands());
    if (experiment_.has_bus() && experiment_.record_frames) write_frames(simulation, utime);
    to_message(simulation.measurements(), measurement_);
    writer_.write_message("MEASUREMENT", utime, measurement_);
    for (std::size_t i = 0; i < simulation.estimates().size(); ++i) {
      to_message(*simulation.estimates()[i], estimate_);
      writer_.write_message(channel_name("EST_", simulation.entries()[i]->name), utime, estimate_);
    }
    for (Smoothed& one : smoothed_) one.stream.on_step(writing(one));
  }

  void finish() {
    for (Smoothed& one : smoothed_) one.stream.finish(writing(one));
  }

 private:
  struct Smoothed {
    std::string channel;
    SmoothedStream stream;
  };

  SmoothedStream::OnEstimate writing(const Smoothed& one) {
    return [this, &one](const Estimate& estimate) {
      to_message(estimate, estimate_);
      // The log's time is when something was said; the estimate's own is when it holds.
      writer_.write_message(one.channel, utime_, estimate_);
    };
  }

  void write_known_input(std::int64_t step) {
    if (!to_message(experiment_.known_input(step), step, utime_, known_input_)) return;
    writer_.write_message("KNOWN_INPUT", utime_, known_input_);
  }

  void write_records(const std::vector<AttackRecord>& records) {
    for (const AttackRecord& record : records) {
      to_message(record, experiment_.rules, experiment_.step_s(), attack_);
      writer_.write_message("ATTACK_FRAME", utime_, attack_);
    }
  }

  // As the plant records them: one message each, by the step at which it acts.
  void write_commands(const std::vector<CanFrame>& commands) {
    for (const CanFrame& frame : commands) {
      const std::optional<ModeChange> command = command_codec_.decode(frame);
      command_.step = command ? command->from_step : 0;
      command_.utime =
          std::llround(static_cast<double>(command_.step) * experiment_.step_s() * 1e6);
      command_.num_frames = 1;
      command_.frames.resize(1);
      to_message(frame, num_commands_++, command_.frames.front());
      writer_.write_message("CAN_COMMAND", utime_, command_);
    }
  }

  // The simulated buses lose nothing: the driver reads what the attacker sent.
  void write_frames(const Simulation& simulation, std::int64_t utime) {
    frames_.utime = utime;
    frames_.step = simulation.truth().step;
    frames_.frames.clear();
    for (const CanFrame& frame : simulation.sent_frames())
      to_message(frame, num_frames_++, frames_.frames.emplace_back());
    frames_.num_frames = static_cast<std::int32_t>(frames_.frames.size());
    writer_.write_message("CAN_TX", utime, frames_);
    writer_.write_message("CAN_RX", utime, frames_);
  }

  const Experiment& experiment_;
  LogWriter& writer_;
  truth_t truth_;
  attack_signal_t signal_;
  known_input_t known_input_;
  attack_frame_t attack_;
  can_frames_t frames_;
  measurement_set_t measurement_;
  estimate_t estimate_;
  CommandCodec command_codec_;
  can_frames_t command_;
  std::int64_t num_frames_ = 0, num_commands_ = 0, utime_ = 0;
  std::vector<Smoothed> smoothed_;
};

}  // namespace

void write_run_log(const Experiment& experiment, std::uint32_t run, const std::string& file) {
  LogWriter writer(file, LogWriter::Appears::kWhenFinished);
  run_meta_t meta = to_message(RunMeta{experiment.name, experiment.resolved, experiment.seed, run,
                                       experiment.kernel_text()});
  writer.write_message("RUN_META", 0, meta);
  Simulation simulation(experiment, run);
  RunLog log(experiment, writer, simulation);
  while (simulation.advance()) log.write(simulation);
  log.finish();
  writer.finish();
}

}  // namespace holdfast
