#include "estimators/vector_filter.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace holdfast {

VectorFilter::VectorFilter(std::unique_ptr<VectorKernel> kernel, const SystemModel& model,
                           const VectorFilterOptions& options, std::vector<std::vector<int>> rows)
    : kernel_(std::move(kernel)),
      inbox_(std::move(rows), model.num_measurements()),
      choice_(options.vector.packet, options.vector.gate_probability, inbox_),
      innovation_(model.num_measurements()),
      has_to_move_(options.start_step == 0) {}

VectorFilter::Finding VectorFilter::correct() {
  Finding finding;
  if (inbox_.num_usable() == 0) return finding;
  kernel_->observe();
  const bool is_chosen =
      choice_.choose(inbox_, [this](std::span<const UsablePacket> packets,
                                    const std::vector<int>& rows, std::span<double> distances) {
        for (std::size_t p = 0; p < packets.size(); ++p) {
          distances[p] = kernel_->distance(rows, packets[p].values);
          if (!std::isfinite(distances[p])) return false;
        }
        return true;
      });
  finding.num_rows = static_cast<int>(choice_.rows().size());
  if (!is_chosen) {
    finding.choice = PacketChoice::Result::kFailed;
  } else if (choice_.rows().empty()) {
    finding.choice = PacketChoice::Result::kRefusedByGate;
    finding.refused_score = choice_.refused_score();
  } else {
    finding.result = kernel_->correct(choice_.rows(), choice_.values());
    log_likelihood_ += finding.result.log_density;
    finding.choice = finding.result.kind == VectorResult::Kind::kFailed
                         ? PacketChoice::Result::kFailed
                         : PacketChoice::Result::kCorrected;
  }
  return finding;
}

const Estimate& VectorFilter::step(std::int64_t step, const MeasurementSet& measurements,
                                   const Eigen::VectorXd& /*known_input*/) {
  inbox_.read(measurements);
  inbox_.begin(step, measurements, estimate_);
  kernel_->begin_step(step, has_to_move_);
  has_to_move_ = true;
  const Finding finding = correct();
  kernel_->end_step();
  innovation_.clear(estimate_);
  if (finding.choice == PacketChoice::Result::kCorrected &&
      finding.result.kind == VectorResult::Kind::kCorrected) {
    innovation_.make_room(static_cast<std::size_t>(finding.num_rows), estimate_);
    kernel_->publish_innovation(estimate_.innovation, estimate_.innovation_covariance);
  } else if (finding.choice == PacketChoice::Result::kFailed) {
    estimate_.outcome = StepOutcome::kFactorisationFailed;
  }
  kernel_->publish(estimate_);
  judge(finding, estimate_);
  if (num_kept_max_ > 0) {
    if (labels_.size() == num_kept_max_) labels_.erase(labels_.begin());
    labels_.push_back({step, measurements.utime, measurements.seq, estimate_.outcome,
                       estimate_.attack_probability});
  }
  return estimate_;
}

void VectorFilter::judge(const Finding& /*finding*/, Estimate& /*estimate*/) {}

void VectorFilter::remember(std::size_t num_steps) {
  num_kept_max_ = num_steps;
  labels_.clear();
  kernel_->remember(num_steps);
}

const std::vector<Estimate>& VectorFilter::smooth() {
  smoothed_.resize(labels_.size());
  kernel_->smooth();
  for (std::size_t i = 0; i < labels_.size(); ++i) {
    Estimate& estimate = smoothed_[i];
    estimate.step = labels_[i].step;
    estimate.utime = labels_[i].utime;
    estimate.measurement_seq = labels_[i].measurement_seq;
    estimate.outcome = labels_[i].outcome;
    estimate.attack_probability = labels_[i].attack_probability;
    kernel_->publish_smoothed(i, estimate);
  }
  return smoothed_;
}

}  // namespace holdfast
