#include "tools/review_metrics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "estimators/estimate.h"
#include "tools/experiment.h"
#include "tools/frame_truth.h"

namespace holdfast {
namespace {

constexpr const char* kRmseOverTime = "rmse_over_time";
constexpr const char* kNeesMean = "nees_mean";
constexpr const char* kPacketRoc = "packets";

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

Eigen::VectorXd vector_of(const std::vector<double>& values) {
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

// Empty when the values are no square matrix of that size: what anybody may have logged.
Eigen::MatrixXd matrix_of(const std::vector<double>& values, std::size_t size) {
  if (size == 0 || values.size() / size != size || values.size() % size != 0) return {};
  const auto side = static_cast<Eigen::Index>(size);
  return Eigen::Map<const RowMajor>(values.data(), side, side);
}

void fill(const Sample& sample, bool has_truth, Estimate& estimate) {
  const bool is_known_outcome =
      sample.outcome >= 0 &&
      sample.outcome <= static_cast<std::int32_t>(StepOutcome::kDegenerateWeights);
  estimate.outcome = is_known_outcome ? static_cast<StepOutcome>(sample.outcome) : StepOutcome::kOk;
  estimate.attack_probability = sample.attack_probability;
  estimate.mean = vector_of(sample.mean);
  estimate.covariance = matrix_of(sample.covariance, sample.mean.size());
  // Without a truth no mode is known to be the true one.
  estimate.mode_probability = has_truth ? sample.mode_probability : std::vector<double>();
  estimate.input_step = sample.input_step;
  estimate.input_mean = vector_of(sample.input_mean);
  estimate.hypotheses.clear();
  for (const MixtureSize& mixture : sample.mixtures) {
    HypothesisEstimate& hypothesis = estimate.hypotheses.emplace_back();
    hypothesis.name = mixture.hypothesis;
    hypothesis.num_components = mixture.num_components;
    hypothesis.num_candidates = mixture.num_candidates;
  }
  estimate.innovation = vector_of(sample.innovation);
  estimate.innovation_covariance =
      matrix_of(sample.innovation_covariance, sample.innovation.size());
}

std::optional<double> finite_value(const Metric* metric) {
  if (metric == nullptr || !std::isfinite(metric->value)) return std::nullopt;
  return metric->value;
}

// Runs of one estimator as rows of one matrix for each curve.
EstimatorRuns gather(const std::string& name, const std::vector<const RunScores*>& runs,
                     std::size_t num_steps) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  EstimatorRuns gathered;
  gathered.estimator = name;
  gathered.packets_of_runs.resize(runs.size());
  for (std::size_t i = 0; i < runs.size(); ++i) {
    if (runs[i] == nullptr) continue;
    for (const auto& [curve, values] : runs[i]->curves) {
      RunMatrix& matrix =
          gathered.curves.try_emplace(curve, runs.size(), num_steps, kNone).first->second;
      std::copy_n(values.begin(), std::min(values.size(), num_steps), matrix.run(i).begin());
    }
    gathered.packets.add(runs[i]->packets);
    gathered.packets_of_runs[i] = runs[i]->packets;
    for (const auto& [outcome, count] : runs[i]->outcomes) gathered.outcomes[outcome] += count;
  }
  return gathered;
}

class Combiner {
 public:
  explicit Combiner(std::vector<const RunReview*> runs) : runs_(std::move(runs)) {
    for (const RunReview* run : runs_) num_steps_ = std::max(num_steps_, run->num_scored);
  }

  CombinedReview combine() {
    result_.name = runs_.front()->name;
    result_.family = runs_.front()->family;
    std::set<std::pair<std::int64_t, std::int64_t>> seen;
    for (const RunReview* run : runs_) {
      result_.files.push_back(run->file);
      if (!seen.insert({run->seed, run->run}).second) {
        result_.notes.push_back("seed " + std::to_string(run->seed) + ", run " +
                                std::to_string(run->run) +
                                " stands in more than one log, so the standard errors are too "
                                "small");
      }
    }
    const auto is_unknown = [](const RunReview* run) { return run->is_attacked.empty(); };
    if (std::ranges::none_of(runs_, is_unknown)) gather_attacks();
    gather_estimators();
    return std::move(result_);
  }

 private:
  void gather_attacks() {
    is_attacked_ = RunMatrix(runs_.size(), static_cast<std::size_t>(num_steps_), 0.0);
    for (std::size_t i = 0; i < runs_.size(); ++i)
      std::ranges::copy(runs_[i]->is_attacked, is_attacked_.run(i).begin());
  }

  void gather_estimators() {
    std::vector<std::string> names;
    for (const RunReview* run : runs_) {
      for (const EstimatorReview& estimator : run->estimators) {
        const bool has_scores = !estimator.scores.curves.empty();
        if (has_scores && std::ranges::find(names, estimator.name) == names.end())
          names.push_back(estimator.name);
      }
    }
    MetricsOptions options = runs_.front()->metrics_options;
    for (const std::string& name : names) {
      EstimatorRuns runs = gather(name, scores_of(name), static_cast<std::size_t>(num_steps_));
      if (is_attacked_.num_runs() > 0) runs.is_attacked = &is_attacked_;
      auto& all = result_.estimators;
      all.push_back(compute_metrics(runs, options));
      if (all.size() == 1) continue;
      for (PairedDifference& difference : paired_differences(all.back(), all.front(), options))
        result_.differences.push_back(std::move(difference));
    }
  }

  std::vector<const RunScores*> scores_of(const std::string& name) {
    std::vector<const RunScores*> scores;
    std::int64_t num_missing = 0;
    for (const RunReview* run : runs_) {
      const auto is_it = [&name](const EstimatorReview& e) { return e.name == name; };
      const auto found = std::ranges::find_if(run->estimators, is_it);
      const bool is_there = found != run->estimators.end() && !found->scores.curves.empty();
      scores.push_back(is_there ? &found->scores : nullptr);
      num_missing += is_there ? 0 : 1;
    }
    if (num_missing > 0) {
      result_.notes.push_back(name + " is missing in " + std::to_string(num_missing) + " of " +
                              std::to_string(runs_.size()) + " logs");
    }
    return scores;
  }

  std::vector<const RunReview*> runs_;
  std::int64_t num_steps_ = 0;
  RunMatrix is_attacked_;
  CombinedReview result_;
};

}  // namespace

RunScores score_estimator(const ScenarioFacts& facts, const LogTrace& trace,
                          const FrameLabels& labels, const std::string& name,
                          const EstimatorTrace& estimator) {
  if (trace.num_scored < 1) return {};
  const EstimatorEntry* entry =
      facts.experiment == nullptr ? nullptr : facts.experiment->find_estimator(name);
  RunScorer scorer(facts.groups, static_cast<std::size_t>(trace.num_scored));
  Estimate estimate;
  for (const auto& [step, sample] : estimator.samples) {
    if (step > trace.num_scored) break;
    TrueStep truth;
    const auto state = trace.truth.find(step);
    if (state != trace.truth.end()) {
      truth.state = state->second.state;
      truth.mode = state->second.mode;
    }
    if (facts.attack_truth == AttackTruth::kFrames) {
      const auto actions = trace.frame_actions.find(step);
      truth.mode = static_cast<int>(
          true_hypothesis(actions != trace.frame_actions.end() ? actions->second : 0));
    }
    if (entry != nullptr) truth.mode = entry->own_mode(truth.mode);
    truth.is_attacked = trace.attacked_steps.contains(step);
    const auto signal = trace.attack_signals.find(step);
    if (signal != trace.attack_signals.end()) truth.attack_signal = signal->second;
    estimate.step = step;
    fill(sample, state != trace.truth.end(), estimate);
    scorer.take(estimate, truth);
  }
  for (const auto& [rx_index, posterior] : estimator.packet_posteriors) {
    const PacketLabel label = labels.find(rx_index).label;
    if (label != PacketLabel::kUnknown)
      scorer.take_packet(posterior, label != PacketLabel::kAuthentic);
  }
  return scorer.finish();
}

std::vector<double> attacked_steps(const LogTrace& trace) {
  if (!trace.knows_attacks) return {};
  std::vector<double> is_attacked(static_cast<std::size_t>(trace.num_scored), 0.0);
  for (const std::int64_t step : trace.attacked_steps) {
    if (step >= 1 && step <= trace.num_scored)
      is_attacked[static_cast<std::size_t>(step - 1)] = 1.0;
  }
  return is_attacked;
}

void review_scores(const RunReview& run, RunScores scores, EstimatorReview& review) {
  for (const StateGroup& group : run.metrics_options.groups)
    review.errors.push_back({group.name, group.unit, std::nullopt});
  if (run.num_scored < 1) return;
  const auto num_steps = static_cast<std::size_t>(run.num_scored);
  EstimatorRuns runs = gather(review.name, {&scores}, num_steps);
  RunMatrix is_attacked(1, num_steps, 0.0);
  if (!run.is_attacked.empty()) {
    std::ranges::copy(run.is_attacked, is_attacked.run(0).begin());
    runs.is_attacked = &is_attacked;
  }
  review.metrics = compute_metrics(runs, run.metrics_options);
  for (GroupError& error : review.errors) {
    error.rmse = finite_value(find_metric(review.metrics, kRmseOverTime, error.name));
  }
  review.nees_mean = finite_value(find_metric(review.metrics, kNeesMean));
  const auto curve = scores.curves.find("nees");
  if (curve != scores.curves.end()) {
    review.nees_steps =
        std::ranges::count_if(curve->second, [](double value) { return std::isfinite(value); });
  }
  for (const RocCurve& roc : review.metrics.rocs) {
    if (roc.name == kPacketRoc && std::isfinite(roc.area)) review.packet_auc = roc.area;
  }
  review.scores = std::move(scores);
}

std::vector<CombinedReview> combine_reviews(const std::vector<RunReview>& reviews) {
  std::vector<std::vector<const RunReview*>> families;
  for (const RunReview& review : reviews) {
    if (review.num_scored < 1 || review.family.empty()) continue;
    const auto is_same = [&review](const auto& family) {
      return family.front()->family == review.family;
    };
    const auto found = std::ranges::find_if(families, is_same);
    if (found == families.end()) {
      families.push_back({&review});
    } else {
      found->push_back(&review);
    }
  }
  std::vector<CombinedReview> combined;
  for (auto& family : families) {
    if (family.size() > 1) combined.push_back(Combiner(std::move(family)).combine());
  }
  return combined;
}

}  // namespace holdfast
