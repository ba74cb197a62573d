#include "estimators/estimate_messages.h"

#include <holdfast/estimate_t.hpp>
#include <stdexcept>

namespace holdfast {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

void put(const Eigen::VectorXd& vector, std::int32_t& count, std::vector<double>& out) {
  count = static_cast<std::int32_t>(vector.size());
  out.assign(vector.data(), vector.data() + vector.size());
}

void put(const Eigen::MatrixXd& matrix, std::int32_t& count, std::vector<double>& out) {
  count = static_cast<std::int32_t>(matrix.size());
  out.resize(static_cast<std::size_t>(matrix.size()));
  Eigen::Map<RowMajor>(out.data(), matrix.rows(), matrix.cols()) = matrix;
}

void take(const std::vector<double>& in, Eigen::VectorXd& vector) {
  vector = Eigen::Map<const Eigen::VectorXd>(in.data(), static_cast<Eigen::Index>(in.size()));
}

// An empty covariance stands for one that the method does not give.
void take(const std::vector<double>& in, std::size_t size, Eigen::MatrixXd& matrix) {
  if (!in.empty() && in.size() != size * size) {
    throw std::invalid_argument("estimate_t: a covariance does not fit its mean");
  }
  const auto side = static_cast<Eigen::Index>(in.empty() ? 0 : size);
  matrix = Eigen::Map<const RowMajor>(in.data(), side, side);
}

}  // namespace

void to_message(const Estimate& estimate, estimate_t& message) {
  message.utime = estimate.utime;
  message.step = estimate.step;
  message.measurement_seq = estimate.measurement_seq;
  message.outcome = static_cast<std::int32_t>(estimate.outcome);
  message.attack_probability = estimate.attack_probability;
  put(estimate.mean, message.num_states, message.mean);
  put(estimate.covariance, message.num_covariance, message.covariance);
  message.num_modes = static_cast<std::int32_t>(estimate.mode_probability.size());
  message.mode_probability = estimate.mode_probability;
  message.input_step = estimate.input_step;
  put(estimate.input_mean, message.num_inputs, message.input_mean);
  put(estimate.input_covariance, message.num_input_covariance, message.input_covariance);
  message.num_hypotheses = static_cast<std::int32_t>(estimate.hypotheses.size());
  message.hypotheses.resize(estimate.hypotheses.size());
  for (std::size_t i = 0; i < estimate.hypotheses.size(); ++i) {
    const HypothesisEstimate& in = estimate.hypotheses[i];
    hypothesis_t& out = message.hypotheses[i];
    out.name = in.name;
    out.probability = in.probability;
    put(in.mean, out.num_states, out.mean);
    put(in.covariance, out.num_covariance, out.covariance);
    out.num_components = in.num_components;
    out.num_candidates = in.num_candidates;
  }
  if (estimate.packet_rx_index.size() != estimate.packet_probability.size()) {
    throw std::invalid_argument(
        "Estimate: packet_rx_index and packet_probability differ in length");
  }
  message.num_packets = static_cast<std::int32_t>(estimate.packet_rx_index.size());
  message.packet_rx_index.assign(estimate.packet_rx_index.begin(), estimate.packet_rx_index.end());
  message.packet_probability = estimate.packet_probability;
  put(estimate.innovation, message.num_innovation, message.innovation);
  put(estimate.innovation_covariance, message.num_innovation_covariance,
      message.innovation_covariance);
}

void from_message(const estimate_t& message, Estimate& estimate) {
  if (message.outcome < 0 ||
      message.outcome > static_cast<std::int32_t>(StepOutcome::kDegenerateWeights)) {
    throw std::invalid_argument("estimate_t: unknown outcome");
  }
  if (message.packet_rx_index.size() != message.packet_probability.size()) {
    throw std::invalid_argument("estimate_t: packet lists differ in length");
  }
  estimate.utime = message.utime;
  estimate.step = message.step;
  estimate.measurement_seq = message.measurement_seq;
  estimate.outcome = static_cast<StepOutcome>(message.outcome);
  estimate.attack_probability = message.attack_probability;
  take(message.mean, estimate.mean);
  take(message.covariance, message.mean.size(), estimate.covariance);
  estimate.mode_probability = message.mode_probability;
  estimate.input_step = message.input_step;
  take(message.input_mean, estimate.input_mean);
  take(message.input_covariance, message.input_mean.size(), estimate.input_covariance);
  estimate.hypotheses.resize(message.hypotheses.size());
  for (std::size_t i = 0; i < message.hypotheses.size(); ++i) {
    const hypothesis_t& in = message.hypotheses[i];
    HypothesisEstimate& out = estimate.hypotheses[i];
    out.name = in.name;
    out.probability = in.probability;
    take(in.mean, out.mean);
    take(in.covariance, in.mean.size(), out.covariance);
    out.num_components = in.num_components;
    out.num_candidates = in.num_candidates;
  }
  estimate.packet_rx_index.assign(message.packet_rx_index.begin(), message.packet_rx_index.end());
  estimate.packet_probability = message.packet_probability;
  take(message.innovation, estimate.innovation);
  take(message.innovation_covariance, message.innovation.size(), estimate.innovation_covariance);
}

}  // namespace holdfast
