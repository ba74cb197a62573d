#include "tools/log_replay.h"

#include <filesystem>
#include <holdfast/estimate_t.hpp>
#include <holdfast/measurement_set_t.hpp>
#include <holdfast/run_meta_t.hpp>
#include <iostream>
#include <optional>

#include "common/log_file.h"
#include "common/measurement_messages.h"
#include "common/status.h"
#include "estimators/estimate_messages.h"
#include "estimators/estimator_session.h"
#include "estimators/smoothed_stream.h"
#include "tools/experiment.h"
#include "tools/log_meta.h"

namespace holdfast {
namespace {

struct Replayed {
  std::string channel;
  std::unique_ptr<Estimator> estimator;
  EstimatorSession session;
  std::optional<SmoothedStream> smoothed;  // with a fixed lag
  std::string smoothed_channel;
};

}  // namespace

void check_new_log(const std::string& log_file, const std::string& out_file) {
  std::error_code error;
  if (std::filesystem::equivalent(log_file, out_file, error)) {
    throw UsageError(out_file + ": is the log to be read; name another file for the new one");
  }
}

void for_each_set(const std::string& program, const std::string& log_file,
                  const std::function<void(const MeasurementSet&, const LogEvent&)>& on_set) {
  LogReader reader(log_file);
  LogEvent event;
  measurement_set_t message;
  MeasurementSet set;
  std::int64_t num_sets = 0, num_refused = 0;
  while (reader.next(event)) {
    if (event.channel != "MEASUREMENT") continue;
    if (!decode_guarded(event.data, message)) {
      ++num_refused;
      continue;
    }
    ++num_sets;
    from_message(message, set);
    on_set(set, event);
  }
  if (!program.empty()) {
    const std::string place = program + ": " + log_file + ": ";
    if (reader.damaged_bytes() > 0) {
      std::cerr << place << reader.damaged_bytes() << " damaged bytes were skipped" << std::endl;
    }
    if (reader.tail_is_torn()) std::cerr << place << "ends in the middle of an event" << std::endl;
    if (num_refused > 0) {
      std::cerr << place << num_refused << " messages on MEASUREMENT are damaged and were skipped"
                << std::endl;
    }
  }
  if (num_sets == 0) throw UsageError(log_file + ": holds no measurement set");
}

void warn_of_kernel(const std::string& program, const Experiment& experiment, const RunMeta& meta) {
  const std::string kernel = experiment.kernel_text();
  if (kernel == meta.kernel) return;
  std::cerr << program << ": the log was made with kernel " << meta.kernel << ", this is " << kernel
            << ": estimates may differ in their last bits" << std::endl;
}

void replay_log(const std::string& log_file, const std::string& out_file, const std::string& name) {
  check_new_log(log_file, out_file);
  const auto [meta, experiment] = read_logged_experiment(log_file);
  warn_of_kernel("holdfast-estimator", experiment, meta);
  std::vector<Replayed> replayed;
  if (!name.empty()) experiment.estimator(name);
  for (const EstimatorEntry& entry : experiment.estimators) {
    const bool is_wanted = name.empty() || entry.name == name;
    if (!is_wanted || entry.is_outside() || entry.is_campaign_only()) continue;
    auto estimator = experiment.make_estimator(entry, static_cast<std::uint32_t>(meta.run));
    EstimatorSession session(*estimator, experiment.num_steps, experiment.step_s(),
                             experiment.known_inputs());
    auto smoothed = fixed_lag_stream(entry, *estimator);
    replayed.push_back({channel_name("EST_", entry.name), std::move(estimator), std::move(session),
                        std::move(smoothed), channel_name("SMOOTHED_", entry.name)});
  }
  if (replayed.empty())
    throw UsageError(log_file + ": its scenario has no estimator that could be run again");

  LogWriter writer(out_file, LogWriter::Appears::kWhenFinished);
  run_meta_t meta_message = to_message(meta);
  writer.write_message("RUN_META", 0, meta_message);
  estimate_t out;
  for_each_set(
      "holdfast-estimator", log_file, [&](const MeasurementSet& set, const LogEvent& event) {
        writer.write(event.channel, set.utime, event.data);
        for (Replayed& one : replayed) {
          const auto write = [&](const std::string& channel, const Estimate& estimate) {
            to_message(estimate, out);
            writer.write_message(channel, estimate.utime, out);
          };
          one.session.on_set(set, [&](const Estimate& estimate) {
            write(one.channel, estimate);
            if (!one.smoothed) return;
            const auto write_smoothed = [&](const Estimate& e) { write(one.smoothed_channel, e); };
            one.smoothed->on_step(write_smoothed);
            if (one.session.is_finished()) one.smoothed->finish(write_smoothed);
          });
        }
      });
  writer.finish();
}

}  // namespace holdfast
