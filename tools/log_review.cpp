#include "tools/log_review.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <holdfast/estimate_t.hpp>
#include <set>

#include "common/errors.h"
#include "common/log_file.h"
#include "common/run_meta.h"
#include "common/status.h"
#include "tools/log_trace.h"
#include "tools/printable_text.h"
#include "tools/scenario_facts.h"

namespace holdfast {
namespace {

std::string outcome_name(std::int32_t outcome) {
  switch (outcome) {
    case estimate_t::OUTCOME_NO_PACKETS:
      return "no_packets";
    case estimate_t::OUTCOME_REFUSED_INPUT:
      return "refused_input";
    case estimate_t::OUTCOME_FACTORISATION_FAILED:
      return "factorisation_failed";
    case estimate_t::OUTCOME_DEGENERATE_WEIGHTS:
      return "degenerate_weights";
    default:
      return "outcome_" + std::to_string(outcome);
  }
}

const char* state_name(std::int32_t state) {
  switch (state) {
    case status_t::STARTING:
      return "starting";
    case status_t::READY:
      return "ready";
    case status_t::RUNNING:
      return "running";
    case status_t::FINISHED:
      return "finished";
    case status_t::FAILED:
      return "failed";
    default:
      return "unknown";
  }
}

TimeSummary summarise(std::vector<double> times_us) {
  if (times_us.empty()) return {};
  std::sort(times_us.begin(), times_us.end());
  const auto rank = [&times_us](double share) {
    return times_us[static_cast<std::size_t>(
                        std::ceil(share * static_cast<double>(times_us.size()))) -
                    1];
  };
  return {static_cast<std::int64_t>(times_us.size()), rank(0.5), rank(0.99), times_us.back()};
}

// Normalised estimation error squared, e' P^-1 e; none without a positive definite P of that size.
std::optional<double> nees(const std::vector<double>& truth, const Sample& sample) {
  const auto n = static_cast<Eigen::Index>(truth.size());
  if (n == 0 || sample.mean.size() != truth.size() ||
      sample.covariance.size() != truth.size() * truth.size()) {
    return std::nullopt;
  }
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::MatrixXd P = Eigen::Map<const RowMajor>(sample.covariance.data(), n, n);
  const Eigen::VectorXd error = Eigen::Map<const Eigen::VectorXd>(sample.mean.data(), n) -
                                Eigen::Map<const Eigen::VectorXd>(truth.data(), n);
  const Eigen::LLT<Eigen::MatrixXd> llt(P);
  if (llt.info() != Eigen::Success) return std::nullopt;
  const double value = error.dot(llt.solve(error));
  return std::isfinite(value) ? std::optional<double>(value) : std::nullopt;
}

void review_errors(const LogTrace& trace, const EstimatorTrace& estimator,
                   const std::vector<StateGroupFacts>& groups, EstimatorReview& review) {
  std::vector<double> square_sum(groups.size(), 0.0);
  std::vector<std::int64_t> count(groups.size(), 0);
  double nees_sum = 0.0;
  for (const auto& [step, sample] : estimator.samples) {
    const bool is_finite = std::all_of(sample.mean.begin(), sample.mean.end(),
                                       [](double v) { return std::isfinite(v); });
    if (sample.outcome != estimate_t::OUTCOME_OK) ++review.outcomes[outcome_name(sample.outcome)];
    if (!is_finite) ++review.non_finite_steps;
    const auto truth = trace.truth.find(step);
    if (truth == trace.truth.end() || !is_finite) continue;
    ++review.num_steps;
    const std::size_t shared = std::min(truth->second.size(), sample.mean.size());
    for (std::size_t g = 0; g < groups.size(); ++g) {
      const auto& states = groups[g].states;
      if (states.empty() || *std::max_element(states.begin(), states.end()) >= shared) continue;
      for (const std::size_t s : states)
        square_sum[g] += std::pow(sample.mean[s] - truth->second[s], 2);
      ++count[g];
    }
    if (const std::optional<double> value = nees(truth->second, sample)) {
      nees_sum += *value;
      ++review.nees_steps;
    }
  }
  for (std::size_t g = 0; g < groups.size(); ++g) {
    GroupError error{groups[g].name, groups[g].unit, std::nullopt};
    if (count[g] > 0) error.rmse = std::sqrt(square_sum[g] / static_cast<double>(count[g]));
    review.errors.push_back(error);
  }
  if (review.nees_steps > 0) review.nees_mean = nees_sum / static_cast<double>(review.nees_steps);
}

void review_packets(const FrameLabels& labels, const EstimatorTrace& estimator,
                    EstimatorReview& review) {
  std::vector<std::pair<double, bool>> scores;
  for (const auto& [rx_index, posterior] : estimator.packet_posteriors) {
    const PacketLabel label = labels.find(rx_index).label;
    if (label == PacketLabel::kUnknown) continue;
    scores.emplace_back(1.0 - posterior, label != PacketLabel::kAuthentic);
  }
  review.packets_scored = static_cast<std::int64_t>(scores.size());
  review.packet_auc = area_under_curve(std::move(scores));
}

// "x_position_m" and "m": "x position [m]".
std::string axis_label(const std::vector<std::string>& names, std::size_t state,
                       const std::string& unit) {
  std::string label = state < names.size() ? names[state] : "state " + std::to_string(state);
  if (!unit.empty() && label.ends_with("_" + unit)) label.resize(label.size() - unit.size() - 1);
  std::replace(label.begin(), label.end(), '_', ' ');
  return unit.empty() ? label : label + " [" + unit + "]";
}

class Reviewer {
 public:
  Reviewer(const ScenarioFacts& facts, const LogTrace& trace, RunReview& review)
      : facts_(facts), trace_(trace), review_(review) {}

  void run() {
    review_.num_steps = trace_.num_steps;
    review_.truth_steps = static_cast<std::int64_t>(trace_.truth.size());
    review_.measurement_steps = static_cast<std::int64_t>(trace_.measurement_steps.size());
    review_processes();
    review_frames();
    review_estimators();
    review_path();
    review_losses();
    add_warnings();
  }

 private:
  void warn(const std::string& text) { review_.warnings.push_back(text); }

  void review_processes() {
    for (const auto& [channel, status] : trace_.statuses) {
      ProcessReview process;
      const bool fits = channel_name("STATUS_", status.name) == channel;
      process.name = fits ? status.name : channel;
      process.state = state_name(status.state);
      process.is_finished = status.state == status_t::FINISHED;
      process.step = status.step;
      process.remark = status.remark;
      for (std::size_t i = 0; i < status.counter_name.size(); ++i) {
        process.counters[status.counter_name[i]] = status.counter_value[i];
      }
      review_.processes.push_back(std::move(process));
    }
  }

  // The process that keeps this counter; processes are told by what they count, not by their names.
  const ProcessReview* process_with(const std::string& counter) const {
    for (const ProcessReview& process : review_.processes) {
      if (process.counters.contains(counter)) return &process;
    }
    return nullptr;
  }

  void review_frames() {
    const ProcessReview* plant = process_with("frames_sent");
    const ProcessReview* driver = process_with("frames");
    const ProcessReview* attacker = process_with("injected");
    review_.frames_recorded = trace_.labeler.num_received();
    if (plant != nullptr) review_.frames_sent = plant->counter("frames_sent");
    if (driver != nullptr) {
      review_.frames_received = driver->counter("frames");
    } else if (review_.frames_recorded > 0) {
      review_.frames_received = review_.frames_recorded;
    }
    review_.frames_touched = trace_.frames_touched;
    for (const auto& [name, rule] : trace_.rules) review_.rules.push_back(rule);
    const auto ended = [this](const ProcessReview* process) {
      return !review_.tail_is_torn && (process == nullptr || process->is_finished);
    };
    review_.frames = trace_.labeler.labels(ended(driver), ended(attacker));
    review_.packets = trace_.packets;
    for (PacketRow& packet : review_.packets) {
      packet.frame = review_.frames.find(packet.rx_index);
      ++review_.packet_count[packet.frame.label];
    }
  }

  void review_estimators() {
    std::map<std::string, EstimatorTrace> outsiders = trace_.estimators;
    for (const auto& [name, is_campaign_only] : facts_.estimators) {
      const std::string suffix = channel_name("", name);
      const auto found = trace_.estimators.find(suffix);
      EstimatorReview review;
      review.name = name;
      review.is_in_scenario = true;
      review.is_campaign_only = is_campaign_only && found == trace_.estimators.end();
      review_estimator(found == trace_.estimators.end() ? EstimatorTrace{} : found->second, suffix,
                       review);
      outsiders.erase(suffix);
    }
    for (const auto& [suffix, estimator] : outsiders) {
      if (estimator.samples.empty()) continue;
      EstimatorReview review;
      review.name = suffix;
      review_estimator(estimator, suffix, review);
    }
  }

  void review_estimator(const EstimatorTrace& estimator, const std::string& suffix,
                        EstimatorReview review) {
    review.channel = "EST_" + suffix;
    review.repeated_steps = estimator.repeated;
    review.missing_steps =
        review.is_campaign_only
            ? 0
            : std::max<std::int64_t>(
                  0, trace_.num_steps - static_cast<std::int64_t>(estimator.samples.size()));
    review_errors(trace_, estimator, facts_.groups, review);
    review_packets(review_.frames, estimator, review);
    review.compute_time = summarise(estimator.compute_time_us);
    review.latency = summarise(estimator.latency_us);
    if (const StateGroupFacts* position = position_group()) {
      for (const auto& [step, sample] : estimator.samples)
        add_point(sample.mean, *position, review.path);
    }
    review_.estimators.push_back(std::move(review));
  }

  const StateGroupFacts* position_group() const {
    for (const StateGroupFacts& group : facts_.groups) {
      if (group.name == "position" && group.states.size() >= 2) return &group;
    }
    return nullptr;
  }

  static void add_point(const std::vector<double>& state, const StateGroupFacts& position,
                        std::vector<PlotPoint>& path) {
    if (std::max(position.states[0], position.states[1]) >= state.size()) return;
    path.push_back({state[position.states[0]], state[position.states[1]]});
  }

  void review_path() {
    const StateGroupFacts* position = position_group();
    if (position == nullptr) return;
    for (const auto& [step, state] : trace_.truth) add_point(state, *position, review_.true_path);
    review_.sensors = facts_.sensors;
    review_.x_label = axis_label(facts_.state_names, position->states[0], position->unit);
    review_.y_label = axis_label(facts_.state_names, position->states[1], position->unit);
  }

  void add_loss(const std::string& where, const std::string& counter, std::int64_t count) {
    if (count <= 0) return;
    review_.losses.push_back({where, counter, count});
    review_.losses_in_all += std::min(count, kCountMax);
  }

  void review_losses() {
    for (const ProcessReview& process : review_.processes) {
      for (const auto& [counter, value] : process.counters) {
        if (counter == "lcm_lost" || counter.ends_with("kernel_dropped") ||
            counter.ends_with("write_dropped")) {
          add_loss(process.name, counter, value);
        }
      }
      review_.refused_by_processes +=
          std::clamp<std::int64_t>(process.counter("lcm_refused"), 0, kCountMax);
    }
    add_loss("monitor bus", "sent by the attacker, not read by the driver", review_.frames.lost);
    for (const auto& [channel, trouble] : trace_.troubles) {
      review_.refused_in_log += trouble.num_refused();
      add_loss("log", "missing on " + channel, trouble.missing_seq);
      if (trouble.num_refused() + trouble.missing_seq + trouble.backward_seq + trouble.odd_step >
          0) {
        review_.troubles[channel] = trouble;
      }
    }
  }

  void add_warnings() {
    for (const Loss& loss : review_.losses) {
      warn("lost: " + std::to_string(loss.count) + " (" + loss.where + ", " + loss.counter + ")");
    }
    for (const ProcessReview& process : review_.processes) {
      if (process.is_finished) continue;
      warn(process.name + " did not finish: its last word, at step " +
           std::to_string(process.step) + ", was '" + process.state + "'" +
           (process.remark.empty() ? "" : ": " + process.remark));
    }
    for (const EstimatorReview& estimator : review_.estimators) warn_of(estimator);
    if (review_.truth_steps < review_.num_steps) {
      warn("the truth is known in " + std::to_string(review_.truth_steps) + " of " +
           std::to_string(review_.num_steps) + " steps");
    }
    if (review_.damaged_bytes > 0)
      warn(std::to_string(review_.damaged_bytes) +
           " bytes of the log are damaged and were skipped");
    if (review_.tail_is_torn) warn("the log ends in the middle of an event");
    if (trace_.scenario_hashes.size() > 1)
      warn("the log holds more than one scenario; the first one counts");
    for (const auto& [channel, trouble] : review_.troubles) {
      if (trouble.backward_seq > 0) {
        warn(channel + ": seq went back " + std::to_string(trouble.backward_seq) +
             " times, so the channel has a second producer or the log a second run");
      }
      if (trouble.odd_step > 0) {
        warn(channel + ": " + std::to_string(trouble.odd_step) +
             " messages of steps that the scenario has not");
      }
    }
  }

  void warn_of(const EstimatorReview& estimator) {
    const auto add = [&](std::int64_t count, const char* text) {
      if (count > 0) warn(estimator.name + ": " + std::to_string(count) + text);
    };
    add(estimator.missing_steps, " steps without an estimate");
    add(estimator.repeated_steps, " further estimates for a step that had one; the first counts");
    add(estimator.non_finite_steps, " estimates that are not finite, left out of the errors");
  }

  // Keeps a sum of counters that anybody may have written from overflowing.
  static constexpr std::int64_t kCountMax = std::int64_t{1} << 40;

  const ScenarioFacts& facts_;
  const LogTrace& trace_;
  RunReview& review_;
};

}  // namespace

std::int64_t ProcessReview::counter(const std::string& counter_name) const {
  const auto found = counters.find(counter_name);
  return found == counters.end() ? 0 : found->second;
}

std::int64_t ChannelTrouble::num_refused() const {
  std::int64_t sum = 0;
  for (const auto& [verdict, count] : refused) sum += count;
  return sum;
}

RunReview review_log(const std::string& file) {
  const RunMeta meta = read_run_meta(file);
  RunReview review;
  review.file = file;
  review.name = meta.name;
  review.seed = meta.seed;
  review.run = meta.run;
  review.scenario_hash = scenario_hash(meta.scenario);
  const ScenarioFacts facts = read_scenario_facts(meta.scenario, file);
  LogReader reader(file);
  const LogTrace trace = collect_trace(reader, facts.num_steps, review.num_events);
  review.damaged_bytes = reader.damaged_bytes();
  review.tail_is_torn = reader.tail_is_torn();
  Reviewer(facts, trace, review).run();
  return review;
}

void write_labels_csv(const RunReview& review, const std::string& file) {
  std::ofstream stream(file);
  stream << "step,rx_index,source,label,tx_index,rule\n";
  for (const PacketRow& packet : review.packets) {
    std::string rule;
    for (const char c : printable(packet.frame.rule))
      rule += c == '"' ? std::string("\"\"") : std::string(1, c);
    stream << packet.step << ',' << packet.rx_index << ',' << packet.source << ','
           << to_string(packet.frame.label) << ',' << packet.frame.tx_index << ",\"" << rule
           << "\"\n";
  }
  if (!stream.flush()) throw JobError(file + ": cannot be written");
}

}  // namespace holdfast
