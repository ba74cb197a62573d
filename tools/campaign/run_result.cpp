#include "tools/campaign/run_result.h"

#include <array>
#include <bit>
#include <cstring>
#include <nlohmann/json.hpp>
#include <optional>

#include "common/clock.h"
#include "estimators/smoothed_stream.h"
#include "tools/simulation.h"

namespace holdfast {
namespace {

static_assert(std::endian::native == std::endian::little);

using PackedJson = nlohmann::json;

template <class Value>
std::vector<std::uint8_t> raw_bytes(const Value* values, std::size_t count) {
  std::vector<std::uint8_t> bytes(count * sizeof(Value));
  if (count > 0) std::memcpy(bytes.data(), values, bytes.size());
  return bytes;
}

template <class Value>
std::vector<Value> raw_values(std::span<const std::uint8_t> bytes) {
  if (bytes.size() % sizeof(Value) != 0) throw JobError("a stored curve is torn");
  std::vector<Value> values(bytes.size() / sizeof(Value));
  if (!values.empty()) std::memcpy(values.data(), bytes.data(), bytes.size());
  return values;
}

PackedJson binary(std::vector<std::uint8_t> bytes) {
  return PackedJson::binary(std::move(bytes));
}

std::span<const std::uint8_t> binary_of(const PackedJson& json) {
  return json.get_ref<const PackedJson::binary_t&>();
}

// True when the proxy altered or made the frame that it sent as the index-th one.
bool is_touched(const std::vector<AttackRecord>& records, std::int64_t tx_index) {
  return std::any_of(records.begin(), records.end(), [tx_index](const AttackRecord& record) {
    return record.tx_index == tx_index;
  });
}

// The simulated buses lose nothing, so the nth frame sent is the nth one received.
void score_packets(const Estimate& estimate, const std::vector<AttackRecord>& records,
                   RunScorer& scorer) {
  for (std::size_t i = 0; i < estimate.packet_rx_index.size(); ++i) {
    scorer.take_packet(estimate.packet_probability[i],
                       is_touched(records, estimate.packet_rx_index[i]));
  }
}

// Counts of one run; a map by names would cost more than the scoring.
struct RunCounters {
  std::int64_t sent = 0, received = 0;
  std::array<std::int64_t, AttackRecord::kNumDispositions> by_disposition{};
  std::array<std::int64_t, 3> by_command_outcome{};

  void add(const Simulation& simulation) {
    sent += static_cast<std::int64_t>(simulation.sent_frames().size());
    received += static_cast<std::int64_t>(simulation.measurements().packets.size());
    for (const AttackRecord& record : simulation.attack_records())
      ++by_disposition[static_cast<std::size_t>(record.disposition)];
    for (std::size_t i = 0; i < by_command_outcome.size(); ++i)
      by_command_outcome[i] += simulation.command_outcomes()[i];
  }

  std::map<std::string, std::int64_t> by_name() const {
    std::map<std::string, std::int64_t> counters = {{"frames_sent_by_proxy", sent},
                                                    {"packets_received", received}};
    for (std::size_t i = 0; i < by_disposition.size(); ++i) {
      if (by_disposition[i] == 0) continue;
      const auto disposition = static_cast<AttackRecord::Disposition>(i);
      counters[std::string("frames_") + to_string(disposition)] = by_disposition[i];
    }
    constexpr std::array<const char*, 3> kOutcomes = {"commands_obeyed", "commands_late",
                                                      "commands_refused"};
    for (std::size_t i = 0; i < kOutcomes.size(); ++i)
      if (by_command_outcome[i] > 0) counters[kOutcomes[i]] = by_command_outcome[i];
    return counters;
  }
};

// Scores what estimators say of past steps, hence keeps the truth of all steps.
class SmoothedScores {
 public:
  SmoothedScores(const Experiment& experiment, Simulation& simulation) {
    for (std::size_t i = 0; i < simulation.entries().size(); ++i) {
      const EstimatorEntry& entry = *simulation.entries()[i];
      if (!entry.is_smoothed) continue;
      auto& estimator = dynamic_cast<SmoothingEstimator&>(simulation.estimator(i));
      streams_.push_back(
          {i, SmoothedStream(estimator, static_cast<std::size_t>(entry.lag_steps)),
           RunScorer(experiment.state_groups, static_cast<std::size_t>(experiment.num_steps))});
    }
  }

  void take(const TrueStep& truth) {
    if (streams_.empty()) return;
    truths_.push_back({{truth.state.begin(), truth.state.end()},
                       truth.mode,
                       truth.is_attacked,
                       {truth.attack_signal.begin(), truth.attack_signal.end()}});
    for (Stream& stream : streams_) stream.smoothed.on_step(scoring(stream));
  }

  /// Scores of the estimator's smoothed estimates, if they are wanted.
  std::optional<RunScores> finish(std::size_t estimator) {
    for (Stream& stream : streams_) {
      if (stream.estimator != estimator) continue;
      stream.smoothed.finish(scoring(stream));
      return stream.scorer.finish();
    }
    return std::nullopt;
  }

 private:
  struct Stream {
    std::size_t estimator;
    SmoothedStream smoothed;
    RunScorer scorer;
  };
  struct Truth {
    std::vector<double> state;
    int mode;
    bool is_attacked;
    std::vector<double> attack_signal;
  };

  SmoothedStream::OnEstimate scoring(Stream& stream) const {
    return [this, &stream](const Estimate& estimate) {
      const Truth& truth = truths_.at(static_cast<std::size_t>(estimate.step - 1));
      stream.scorer.take(estimate,
                         {truth.state, truth.mode, truth.is_attacked, truth.attack_signal});
    };
  }

  std::vector<Stream> streams_;
  std::vector<Truth> truths_;
};

void finish_estimator(const std::string& name, RunScores scores, const Experiment& experiment,
                      const std::vector<double>& is_attacked, EstimatorResult& result) {
  result.name = name;
  result.scores = std::move(scores);
  const auto probability = result.scores.curves.find("attack_probability");
  if (probability == result.scores.curves.end()) return;
  result.detections =
      detection_events(probability->second, is_attacked, experiment.detection_threshold);
}

}  // namespace

RunResult simulate_run(const Experiment& experiment, std::int64_t point, std::int64_t run) {
  const auto num_steps = static_cast<std::size_t>(experiment.num_steps);
  RunResult result;
  result.point = point;
  result.run = run;
  result.is_attacked.reserve(num_steps);
  const bool needs_authentic = std::ranges::any_of(
      experiment.windows, [](const MetricsWindow& window) { return window.fresh_steps >= 0; });
  Simulation simulation(experiment, static_cast<std::uint32_t>(run));
  std::vector<RunScorer> scorers;
  scorers.reserve(simulation.entries().size());
  for (std::size_t i = 0; i < simulation.entries().size(); ++i)
    scorers.emplace_back(experiment.state_groups, num_steps);
  result.estimators.resize(scorers.size());
  simulation.on_step_time = [&result](std::size_t i, std::int64_t time_ns) {
    result.estimators[i].step_times.add(time_ns);
  };
  SmoothedScores smoothed(experiment, simulation);
  RunCounters counters;
  while (simulation.advance()) {
    const PlantStep& truth = simulation.truth();
    const bool attacked = simulation.is_attacked();
    result.is_attacked.push_back(attacked ? 1.0 : 0.0);
    if (needs_authentic)
      result.authentic_packets.push_back(static_cast<double>(simulation.num_authentic()));
    counters.add(simulation);
    const TrueStep true_step{{truth.state.data(), static_cast<std::size_t>(truth.state.size())},
                             simulation.true_mode(),
                             attacked,
                             simulation.true_attack()};
    for (std::size_t i = 0; i < scorers.size(); ++i) {
      const Estimate& estimate = *simulation.estimates()[i];
      TrueStep believed = true_step;
      believed.mode = simulation.entries()[i]->own_mode(true_step.mode);
      scorers[i].take(estimate, believed);
      score_packets(estimate, simulation.attack_records(), scorers[i]);
    }
    smoothed.take(true_step);
  }
  result.counters = counters.by_name();
  if (const std::int64_t refused = simulation.assembler_counters().wrong_checksum; refused > 0)
    result.counters["frames_wrong_checksum"] = refused;
  std::vector<EstimatorResult> finished;
  for (std::size_t i = 0; i < scorers.size(); ++i) {
    const EstimatorEntry& entry = *simulation.entries()[i];
    finish_estimator(entry.name, scorers[i].finish(), experiment, result.is_attacked,
                     finished.emplace_back(std::move(result.estimators[i])));
    if (auto scores = smoothed.finish(i)) {
      finish_estimator(entry.smoothed_name(), *std::move(scores), experiment, result.is_attacked,
                       finished.emplace_back());
    }
  }
  result.estimators = std::move(finished);
  return result;
}

std::vector<std::uint8_t> bytes_of(std::span<const double> values) {
  return raw_bytes(values.data(), values.size());
}

std::vector<double> doubles_of(std::span<const std::uint8_t> bytes) {
  return raw_values<double>(bytes);
}

std::vector<std::uint8_t> bytes_of(const ScoreHistogram& histogram) {
  std::vector<std::int64_t> bins;
  for (std::size_t i = 0; i < histogram.positives.size(); ++i) {
    if (histogram.positives[i] == 0 && histogram.negatives[i] == 0) continue;
    bins.insert(bins.end(),
                {static_cast<std::int64_t>(i), histogram.positives[i], histogram.negatives[i]});
  }
  return raw_bytes(bins.data(), bins.size());
}

ScoreHistogram score_histogram_of(std::span<const std::uint8_t> bytes) {
  const std::vector<std::int64_t> bins = raw_values<std::int64_t>(bytes);
  ScoreHistogram histogram;
  for (std::size_t i = 0; i + 2 < bins.size(); i += 3) {
    if (bins[i] < 0 || bins[i] >= static_cast<std::int64_t>(ScoreHistogram::kNumBins))
      throw JobError("a stored histogram has a bin that there is not");
    histogram.add_counts(static_cast<std::size_t>(bins[i]), bins[i + 1], bins[i + 2]);
  }
  return histogram;
}

std::vector<std::uint8_t> bytes_of(const TimeHistogram& histogram) {
  std::vector<std::int64_t> values = {histogram.longest_ns};
  for (std::size_t i = 0; i < TimeHistogram::kNumBuckets; ++i) {
    if (histogram.buckets[i] == 0) continue;
    values.insert(values.end(), {static_cast<std::int64_t>(i), histogram.buckets[i]});
  }
  return raw_bytes(values.data(), values.size());
}

TimeHistogram time_histogram_of(std::span<const std::uint8_t> bytes) {
  const std::vector<std::int64_t> values = raw_values<std::int64_t>(bytes);
  TimeHistogram histogram;
  if (!values.empty()) histogram.longest_ns = values.front();
  for (std::size_t i = 1; i + 1 < values.size(); i += 2) {
    if (values[i] < 0 || values[i] >= static_cast<std::int64_t>(TimeHistogram::kNumBuckets))
      throw JobError("a stored histogram has a bucket that there is not");
    histogram.buckets[static_cast<std::size_t>(values[i])] += values[i + 1];
  }
  return histogram;
}

std::vector<std::uint8_t> to_bytes(const RunResult& result) {
  PackedJson json = {{"point", result.point}, {"run", result.run}, {"counters", result.counters}};
  json["is_attacked"] = binary(bytes_of(result.is_attacked));
  json["authentic_packets"] = binary(bytes_of(result.authentic_packets));
  json["estimators"] = PackedJson::array();
  for (const EstimatorResult& estimator : result.estimators) {
    PackedJson entry = {{"name", estimator.name}, {"outcomes", estimator.scores.outcomes}};
    entry["curves"] = PackedJson::object();
    for (const auto& [name, values] : estimator.scores.curves)
      entry["curves"][name] = binary(bytes_of(values));
    entry["packets"] = binary(bytes_of(estimator.scores.packets));
    entry["detections"] = PackedJson::array();
    for (const DetectionEvent& event : estimator.detections)
      entry["detections"].push_back({event.first_step, event.last_step, event.detected_step});
    entry["step_times"] = binary(bytes_of(estimator.step_times));
    json["estimators"].push_back(std::move(entry));
  }
  return PackedJson::to_msgpack(json);
}

RunResult run_result_from(std::span<const std::uint8_t> bytes) {
  RunResult result;
  try {
    const PackedJson json = PackedJson::from_msgpack(bytes.begin(), bytes.end());
    result.point = json.at("point");
    result.run = json.at("run");
    json.at("counters").get_to(result.counters);
    result.is_attacked = doubles_of(binary_of(json.at("is_attacked")));
    result.authentic_packets = doubles_of(binary_of(json.at("authentic_packets")));
    for (const PackedJson& entry : json.at("estimators")) {
      EstimatorResult estimator;
      entry.at("name").get_to(estimator.name);
      entry.at("outcomes").get_to(estimator.scores.outcomes);
      for (const auto& [name, values] : entry.at("curves").items())
        estimator.scores.curves[name] = doubles_of(binary_of(values));
      estimator.scores.packets = score_histogram_of(binary_of(entry.at("packets")));
      for (const PackedJson& event : entry.at("detections"))
        estimator.detections.push_back({event.at(0), event.at(1), event.at(2)});
      estimator.step_times = time_histogram_of(binary_of(entry.at("step_times")));
      result.estimators.push_back(std::move(estimator));
    }
  } catch (const PackedJson::exception& error) {
    throw JobError(std::string("a run's result arrived damaged: ") + error.what());
  }
  return result;
}

}  // namespace holdfast
