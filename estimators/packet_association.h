#pragma once

#include <span>
#include <vector>

#include "estimators/kalman_core.h"
#include "estimators/packet_inbox.h"

namespace holdfast {

/// Which packet of a source is the true one, if any: probabilistic data association of one belief.
///
/// Extra packet injection, paper 003 eqs. (23)-(25): the true packet arrives with probability pd, a
/// fake one has the density kappa = 1 / volume of a box, everywhere. With n packets, and
/// q(y) = N(y; h, S),
///
///   N = 1 - pd + pd / n sum_y q(y) / kappa(y)
///   P(y is true) = pd q(y) / (n kappa(y) N),  P(none is) = (1 - pd) / N
///
/// which is the nonparametric filter of Bar-Shalom and Fortmann with the box for the gate. The
/// mixture is replaced by the Gaussian of equal moments.
class PacketAssociation {
 public:
  /// low, high [l]: the box. Throws UsageError when it is empty in a row or pd is no probability.
  PacketAssociation(double delivery_probability, const std::vector<double>& low,
                    const std::vector<double>& high, const PacketInbox& inbox);

  /// Weighs the packets (at least one) of a source. Precondition: the core has observed the belief.
  /// False when S cannot be factorised.
  bool weigh(std::span<const UsablePacket> packets, int source, const PacketInbox& inbox,
             KalmanCore& core);
  /// log N of the packets weighed.
  double log_likelihood() const { return log_likelihood_; }
  double weight_none() const { return weight_none_; }
  /// Of each packet weighed.
  const std::vector<double>& weights() const { return weights_; }
  /// Smallest nu' S^-1 nu of the packets weighed.
  double nearest_distance() const { return nearest_; }

  /// Corrects the belief that was weighed.
  void correct(std::span<const UsablePacket> packets, KalmanCore& core, Gaussian& belief);

 private:
  double log_missed_, log_delivered_;
  std::vector<double> log_kappa_;  // of each source
  std::vector<double> weights_;
  double weight_none_ = 0.0, log_likelihood_ = 0.0, nearest_ = 0.0;
  Eigen::VectorXd mean_;
  Eigen::MatrixXd second_;
};

}  // namespace holdfast
