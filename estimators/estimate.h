#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

namespace holdfast {

/// How a step of an estimator went; numbers are those of estimate_t.
enum class StepOutcome : std::int32_t {
  kOk = 0,
  kNoPackets = 1,     // predicted only
  kRefusedInput = 2,  // non-finite or out of range; that input was left out
  kFactorisationFailed = 3,
  kDegenerateWeights = 4  // every hypothesis or particle had weight zero; weights were kept
};

/// The estimate given one hypothesis about the attack or the mode.
struct HypothesisEstimate {
  std::string name;
  double probability = 0.0;
  Eigen::VectorXd mean;        // [n]
  Eigen::MatrixXd covariance;  // [n x n]
  int num_components = 0;      // Gaussians of its mixture, after reduction; 0: no mixture
  int num_candidates = 0;      // before pruning and merging
};

/// What an estimator says after one step. A field that a method does not give stays empty.
struct Estimate {
  std::int64_t step = 0;
  std::int64_t utime = 0;  // us, time of validity, from the measurement set
  std::int64_t measurement_seq = 0;
  StepOutcome outcome = StepOutcome::kOk;
  Eigen::VectorXd mean;              // [n]
  Eigen::MatrixXd covariance;        // [n x n]
  double attack_probability = -1.0;  // of the step being attacked; -1: the method gives none
  std::vector<double> mode_probability;
  std::int64_t input_step = -1;  // step to which the attack (input) estimate belongs
  Eigen::VectorXd input_mean;
  Eigen::MatrixXd input_covariance;
  std::vector<HypothesisEstimate> hypotheses;
  std::vector<std::int64_t> packet_rx_index;
  std::vector<double> packet_probability;  // posterior of each packet being authentic
  Eigen::VectorXd innovation;              // [m], y - C x_pred
  Eigen::MatrixXd innovation_covariance;   // [m x m]
};

}  // namespace holdfast
