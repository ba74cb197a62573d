#include "estimators/packet_association.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/errors.h"

namespace holdfast {

PacketAssociation::PacketAssociation(double delivery_probability, const std::vector<double>& low,
                                     const std::vector<double>& high, const PacketInbox& inbox)
    : log_missed_(std::log1p(-delivery_probability)),
      log_delivered_(std::log(delivery_probability)) {
  if (!(delivery_probability > 0.0 && delivery_probability <= 1.0)) {
    throw UsageError("delivery_probability must be above 0 and at most 1");
  }
  std::size_t rows_max = 0;
  for (int s = 0; s < inbox.num_sources(); ++s) {
    double log_kappa = 0.0;
    for (const int row : inbox.rows(s)) {
      const auto r = static_cast<std::size_t>(row);
      if (r >= low.size() || r >= high.size() || !(low[r] < high[r]) ||
          !std::isfinite(high[r] - low[r])) {
        throw UsageError("packet_box must have low < high in every row of y");
      }
      log_kappa -= std::log(high[r] - low[r]);
    }
    log_kappa_.push_back(log_kappa);
    rows_max = std::max(rows_max, inbox.rows(s).size());
  }
  const auto size = static_cast<Eigen::Index>(rows_max);
  mean_.resize(size);
  second_.resize(size, size);
}

bool PacketAssociation::weigh(std::span<const UsablePacket> packets, int source,
                              const PacketInbox& inbox, KalmanCore& core) {
  if (!core.use_rows(inbox.rows(source))) return false;
  const double log_factor = log_delivered_ - std::log(static_cast<double>(packets.size())) -
                            log_kappa_[static_cast<std::size_t>(source)];
  nearest_ = std::numeric_limits<double>::infinity();
  weights_.clear();
  double log_max = log_missed_;
  for (const UsablePacket& packet : packets) {
    const double distance = core.innovate(packet.values);
    nearest_ = std::min(nearest_, distance);
    weights_.push_back(log_factor + core.log_density(distance));
    log_max = std::max(log_max, weights_.back());
  }
  weight_none_ = std::exp(log_missed_ - log_max);
  double sum = weight_none_;
  for (double& weight : weights_) {
    weight = std::exp(weight - log_max);
    sum += weight;
  }
  weight_none_ /= sum;
  for (double& weight : weights_) weight /= sum;
  log_likelihood_ = log_max + std::log(sum);
  return true;
}

void PacketAssociation::correct(std::span<const UsablePacket> packets, KalmanCore& core,
                                Gaussian& belief) {
  auto mean = mean_.head(core.num_rows());
  auto second = second_.topLeftCorner(core.num_rows(), core.num_rows());
  mean.setZero();
  second.setZero();
  for (std::size_t p = 0; p < packets.size(); ++p) {
    if (weights_[p] == 0.0) continue;
    core.innovate(packets[p].values);
    mean += weights_[p] * core.innovation();
    second.noalias() += (weights_[p] * core.innovation()) * core.innovation().transpose();
  }
  core.correct_by_mixture(weight_none_, mean, second, belief);
}

}  // namespace holdfast
