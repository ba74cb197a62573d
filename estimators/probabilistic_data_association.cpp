#include "estimators/probabilistic_data_association.h"

#include <utility>

#include "common/chi_square.h"

namespace holdfast {

ProbabilisticDataAssociation::ProbabilisticDataAssociation(
    const SystemModel& model, const ProbabilisticDataAssociationOptions& options,
    std::vector<std::vector<int>> rows)
    : core_(model),
      inbox_(std::move(rows), model.num_measurements()),
      association_(options.delivery_probability, options.packet_box.low, options.packet_box.high,
                   inbox_),
      belief_(options.start.gaussian(model.num_states())) {}

const Estimate& ProbabilisticDataAssociation::step(std::int64_t step,
                                                   const MeasurementSet& measurements,
                                                   const Eigen::VectorXd& /*known_input*/) {
  inbox_.read(measurements);
  inbox_.begin(step, measurements, estimate_);
  PacketInbox::list_packets(measurements, estimate_);
  if (has_started_) core_.predict(belief_);
  has_started_ = true;
  if (inbox_.num_usable() > 0) correct();
  estimate_.mean = belief_.mean;
  estimate_.covariance = belief_.covariance;
  estimate_.attack_probability = score_;
  return estimate_;
}

void ProbabilisticDataAssociation::correct() {
  double distance = 0.0, rows = 0.0;
  for (int s = 0; s < inbox_.num_sources(); ++s) {
    const std::span<const UsablePacket> packets = inbox_.packets(s);
    if (packets.empty()) continue;
    core_.observe(belief_);
    if (!association_.weigh(packets, s, inbox_, core_)) {
      estimate_.outcome = StepOutcome::kFactorisationFailed;
      continue;
    }
    association_.correct(packets, core_, belief_);
    for (std::size_t p = 0; p < packets.size(); ++p) {
      estimate_.packet_probability[packets[p].index] = association_.weights()[p];
    }
    distance += association_.nearest_distance();
    rows += static_cast<double>(core_.num_rows());
  }
  if (rows > 0.0) score_ = chi_square_distribution(distance, rows);
}

}  // namespace holdfast
