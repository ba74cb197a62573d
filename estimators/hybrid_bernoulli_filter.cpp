#include "estimators/hybrid_bernoulli_filter.h"

#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "common/errors.h"
#include "estimators/hybrid_bernoulli_correction.h"
#include "estimators/hybrid_bernoulli_estimate.h"
#include "estimators/hybrid_bernoulli_packets.h"
#include "estimators/hybrid_bernoulli_prediction.h"
#include "estimators/mixture_reduction.h"
#include "estimators/packet_history.h"

namespace holdfast {
namespace {

void forget_origins(GaussianMixture& mixture) {
  for (int j = 0; j < mixture.size(); ++j) {
    ComponentTag tag = mixture.tag(j);
    tag.origin = -1;
    mixture.set_tag(j, tag);
  }
}

void put_on_origins(const GaussianMixture& mixture, double log_probability,
                    PacketHistory& history) {
  for (int j = 0; j < mixture.size(); ++j) {
    history.put(mixture.tag(j).origin, std::exp(log_probability + mixture.log_weight(j)));
  }
}

HybridBernoulliOptions checked(const SystemModel& model, const HybridBernoulliOptions& options) {
  std::string text;
  for (const std::string& problem : model.problems()) text += "\n  model: " + problem;
  for (const std::string& problem : options.problems(model)) text += "\n  " + problem;
  if (!text.empty()) throw UsageError("hybrid Bernoulli filter:" + text);
  return options.completed(model);
}

HybridBernoulliLayout layout_of(const SystemModel& model, const HybridBernoulliOptions& options) {
  using Feedthrough = HybridBernoulliOptions::Feedthrough;
  HybridBernoulliLayout layout;
  layout.num_states = model.num_states();
  layout.num_channels = model.num_attack_channels();
  layout.is_delayed = options.feedthrough == Feedthrough::kDelayed ||
                      (options.feedthrough == Feedthrough::kAuto && model.H.isZero(0.0));
  layout.has_memory =
      !layout.is_delayed &&
      Eigen::ColPivHouseholderQR<Eigen::MatrixXd>(model.H).rank() < layout.num_channels;
  return layout;
}

}  // namespace

struct HybridBernoulliFilter::Parts {
  Parts(const SystemModel& model, const HybridBernoulliOptions& complete,
        const std::vector<std::vector<int>>& rows)
      : options(complete),
        layout(layout_of(model, complete)),
        packets(model, complete, rows),
        prediction(model, complete, layout),
        correction(model, complete, layout, rows),
        reduction(complete),
        output(complete, layout) {
    for (HybridBernoulliBelief* each : {&belief, &spare}) {
      each->p0 = GaussianMixture(layout.dimension0());
      each->p1 = GaussianMixture(layout.dimension1());
    }
  }

  void start();
  void predict();
  StepOutcome correct();
  void reduce(PacketHistory* noted = nullptr);
  void judge_packets();

  HybridBernoulliOptions options;
  HybridBernoulliLayout layout;
  HybridBernoulliPackets packets;
  HybridBernoulliPrediction prediction;
  HybridBernoulliCorrection correction;
  MixtureReduction reduction;
  PacketHistory history;  // of the nodes of one step
  HybridBernoulliOutput output;
  HybridBernoulliBelief belief, spare;
  bool is_predicted = true;  // whether the belief is that before a correction
  std::vector<double> packet_probability;
  std::int64_t refused = 0;
  std::array<std::size_t, 2> candidates{};  // of p0 and p1 in the last step
};

void HybridBernoulliFilter::Parts::start() {
  belief.set_attack_probability(options.start_attack_probability);
  ComponentTag tag;
  if (options.delivery_prior) {
    tag.delivered = options.delivery_prior->alpha;
    tag.lost = options.delivery_prior->beta;
  }
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(layout.dimension0());
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(layout.dimension0(), layout.dimension0());
  mean.head(layout.num_states) = options.start_mean;
  covariance.topLeftCorner(layout.num_states, layout.num_states) = options.start_covariance;
  belief.p0.add(0.0, mean, covariance, tag);
  prediction.join_independently(belief.p0, belief.p1);
}

void HybridBernoulliFilter::Parts::predict() {
  prediction.predict(belief, spare);
  std::swap(belief, spare);
}

StepOutcome HybridBernoulliFilter::Parts::correct() {
  StepOutcome outcome = StepOutcome::kOk;
  candidates = {};
  const auto& nodes = packets.nodes();
  const bool has_packets = std::any_of(nodes.begin(), nodes.end(),
                                       [](const PacketNode& node) { return node.count() > 0; });
  const auto is_due = [&](const PacketNode& node) {
    // A step without packets still prunes.
    const bool is_heard = has_packets ? node.count() > 0 : &node == &nodes.front();
    return is_heard || options.delivery_prior.has_value();
  };
  // The only node needs no history: its packets are judged before anything is dropped.
  const bool is_noted = has_packets && std::count_if(nodes.begin(), nodes.end(), is_due) > 1;
  PacketHistory* const noted = is_noted ? &history : nullptr;
  if (is_noted) {
    // Origins of an earlier step, or of a belief that was set, mean nothing here.
    history.clear();
    forget_origins(belief.p0);
    forget_origins(belief.p1);
  }
  const double log_r = belief.log_r, log_not_r = belief.log_not_r;
  for (const PacketNode& node : nodes) {
    if (!is_due(node)) continue;
    // Merging waits for the last node, unless too much is left for the next.
    const int size = std::max(belief.p0.size(), belief.p1.size());
    if (candidates[0] > 0 && size > options.components_max) reduce(noted);
    const StepOutcome of_node = correction.correct(belief, node, spare, packet_probability, noted);
    if (of_node != StepOutcome::kOk) outcome = of_node;
    for (std::size_t i = 0; i < 2; ++i) candidates[i] += correction.num_candidates()[i];
    std::swap(belief, spare);
  }
  if (is_noted) judge_packets();
  reduce();
  if (!has_packets && !options.delivery_prior) {
    belief.log_r = log_r;
    belief.log_not_r = log_not_r;
  }
  return outcome;
}

void HybridBernoulliFilter::Parts::reduce(PacketHistory* noted) {
  reduction.reduce(belief.p0, spare.p0, noted);
  reduction.reduce(belief.p1, spare.p1, noted);
  std::swap(belief.p0, spare.p0);
  std::swap(belief.p1, spare.p1);
}

void HybridBernoulliFilter::Parts::judge_packets() {
  put_on_origins(belief.p0, belief.log_not_r, history);
  put_on_origins(belief.p1, belief.log_r, history);
  history.pass_on(packet_probability);
  for (double& probability : packet_probability) probability = std::min(probability, 1.0);
}

HybridBernoulliFilter::HybridBernoulliFilter(const SystemModel& model,
                                             const HybridBernoulliOptions& options,
                                             std::vector<std::vector<int>> rows)
    : parts_(std::make_unique<Parts>(model, checked(model, options), rows)) {
  parts_->start();
}

HybridBernoulliFilter::~HybridBernoulliFilter() = default;

const Estimate& HybridBernoulliFilter::step(std::int64_t step, const MeasurementSet& measurements,
                                            const Eigen::VectorXd& /*known_input*/) {
  Parts& parts = *parts_;
  if (!parts.is_predicted) parts.predict();
  parts.is_predicted = false;
  const int refused = parts.packets.read(measurements);
  parts.refused += refused;
  parts.packet_probability.assign(measurements.packets.size(), 0.0);
  const StepOutcome outcome = parts.correct();
  const bool has_none = refused == static_cast<int>(measurements.packets.size());
  const StepOutcome told = outcome != StepOutcome::kOk ? outcome
                           : refused > 0               ? StepOutcome::kRefusedInput
                           : has_none                  ? StepOutcome::kNoPackets
                                                       : StepOutcome::kOk;
  return parts.output.write(step, told, measurements, parts.packet_probability, parts.belief,
                            parts.candidates);
}

const HybridBernoulliBelief& HybridBernoulliFilter::belief() const {
  return parts_->belief;
}

const HybridBernoulliLayout& HybridBernoulliFilter::layout() const {
  return parts_->layout;
}

void HybridBernoulliFilter::set_belief(const HybridBernoulliBelief& belief, bool as_predicted) {
  const HybridBernoulliLayout& layout = parts_->layout;
  if (belief.p0.dimension() != layout.dimension0() || belief.p0.size() == 0 ||
      belief.p1.dimension() != layout.dimension1() || belief.p1.size() == 0) {
    throw UsageError("hybrid Bernoulli filter: the belief does not fit the layout");
  }
  parts_->belief = belief;
  parts_->is_predicted = as_predicted;
}

double HybridBernoulliFilter::delivery_probability() const {
  if (!parts_->options.delivery_prior) return parts_->options.delivery_probability;
  const auto mean_of = [](const GaussianMixture& mixture) {
    double mean = 0.0, sum = 0.0;
    for (int j = 0; j < mixture.size(); ++j) {
      const ComponentTag& tag = mixture.tag(j);
      mean += mixture.weight(j) * tag.delivered / (tag.delivered + tag.lost);
      sum += mixture.weight(j);
    }
    return mean / sum;
  };
  const double r = attack_probability();
  return (1.0 - r) * mean_of(p0()) + r * mean_of(p1());
}

std::int64_t HybridBernoulliFilter::num_candidates() const {
  return static_cast<std::int64_t>(parts_->candidates[0] + parts_->candidates[1]);
}

std::int64_t HybridBernoulliFilter::refused_packets() const {
  return parts_->refused;
}

}  // namespace holdfast
