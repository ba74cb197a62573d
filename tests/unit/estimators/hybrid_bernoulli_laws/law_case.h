#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/models/system_model.h"

namespace holdfast::testing {

/// One term of the density of an attack signal: weight N(mean, covariance), over its channels.
struct SignalTerm {
  double weight = 1.0;
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
};

/// What an attack may be: which channels it drives, and with which signal.
struct AttackLaw {
  double probability = 1.0;  // given that there is an attack
  std::vector<int> channels;
  std::vector<SignalTerm> terms;
};

enum class CorrectionLaw { kInjection, kSubstitution };
inline constexpr auto kInjection = CorrectionLaw::kInjection;
inline constexpr auto kSubstitution = CorrectionLaw::kSubstitution;

/// Density of fakes outside the box: as inside, a small part of it, or 0 (then a packet out there
/// is certainly authentic; of several, each equally).
enum class OutsideLaw { kConstant, kFloor, kZero };

struct LawPacket {
  Eigen::VectorXd y;
  int source = 0;
};

/// What arrives at one step, and which of the two data attacks may have touched it.
struct LawStep {
  CorrectionLaw correction = kInjection;
  std::vector<LawPacket> packets;
};

/// A hybrid Bernoulli problem of few dimensions and what is received: the input of every route.
struct LawCase {
  SystemModel model;
  bool is_direct = true;  // y_k sees a_k; otherwise a_{k-1} through x_k
  double pb = 0.15, ps = 0.8, pd = 0.9, pf = 0.2;
  // Beta prior of the delivery probability, shared by all nodes; 0, 0: it is pd.
  double delivered_count = 0.0, lost_count = 0.0;
  double persistence = 0.0;  // of the attack law while an attack goes on; else it is drawn anew
  double start_probability = 0.3;
  Eigen::VectorXd start_mean;
  Eigen::MatrixXd start_covariance;
  std::vector<AttackLaw> attacks;
  std::vector<std::vector<int>> rows;  // of y, that a packet of each source carries
  Eigen::VectorXd box_low, box_high;   // of fake packets, per row of y
  OutsideLaw outside = OutsideLaw::kConstant;
  double floor = 1e-3;  // kFloor: density outside over that inside
  std::vector<LawStep> steps;

  int n() const { return model.num_states(); }
  int m() const { return model.num_attack_channels(); }
  /// Probability of this attack law when an attack goes on, and before it was that one.
  double attack_probability(std::size_t attack, std::size_t before) const {
    return (1.0 - persistence) * attacks[attack].probability +
           (attack == before ? persistence : 0.0);
  }
  bool is_delivery_unknown() const { return delivered_count > 0.0; }
};

/// What is known after a step: everything that the routes are compared by. Moments are raw (second
/// moments about 0), so that they mix linearly. z = [x; a] with a over all channels of the model,
/// 0 where an attack does not drive one.
struct LawPosterior {
  double r = 0.0;
  Eigen::VectorXd mean0, mean1;            // of x given no attack, of z given attack
  Eigen::MatrixXd square0, square1;        // E[x x'], E[z z']
  std::vector<double> attack_probability;  // of each attack law, given an attack
  std::vector<double> packet_probability;  // of each packet being the authentic one
  double delivery_probability = 0.0;       // posterior mean of pd
  // Of the attack of the step before, in the light of this step: its probability, and the moments
  // of its signal if there was one. Empty after the first step and where a route does not give
  // them.
  double r_before = 0.0;
  Eigen::VectorXd mean_before;    // [m]
  Eigen::MatrixXd square_before;  // [m x m]

  Eigen::MatrixXd covariance0() const { return square0 - mean0 * mean0.transpose(); }
  Eigen::MatrixXd covariance1() const { return square1 - mean1 * mean1.transpose(); }
};

/// The larger one; NaN when either is.
double worse(double a, double b);

/// Largest difference of two matrices, over the scale of either when that is above 1; infinite when
/// their sizes differ, NaN when something is NaN.
double difference(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

/// Largest difference of r, of means and covariances (over their scale) and of the probabilities
/// that both have; NaN when something is NaN.
double disagreement(const LawPosterior& a, const LawPosterior& b);

/// Is any value out of the box of fake packets?
bool is_outside(const LawCase& law, const LawPacket& packet);

/// Density of fake packets over the rows that the packet has.
double fake_density(const LawCase& law, const LawPacket& packet);

/// One way to explain the packets of a step: which are authentic, at most one of each node. Sources
/// whose rows overlap, directly or in a chain, are one node.
struct Association {
  std::vector<int> authentic;  // indices of packets
  double factor = 1.0;         // of the likelihood, without that of the authentic values and of pd
  int num_delivered = 0, num_lost = 0;  // powers of pd and 1 - pd
};

/// Every association of a step. Injection: eq. (14) of paper 003 per node with a packet;
/// substitution: eq. (55) of paper 000 for the one packet.
std::vector<Association> associations(const LawCase& law, const LawStep& step);

}  // namespace holdfast::testing
