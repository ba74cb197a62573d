#pragma once

#include <optional>
#include <vector>

#include "estimators/estimator.h"
#include "estimators/innovation_record.h"
#include "estimators/multiple_model_options.h"
#include "estimators/packet_inbox.h"

namespace holdfast {

/// One vector of all rows of Z_k for filters with unknown inputs, and which of its rows arrived.
class VectorOfRows {
 public:
  /// Throws UsageError when rows or options do not fit.
  VectorOfRows(const VectorOptions& options, std::vector<std::vector<int>> rows,
               int num_measurements);

  /// Takes the packets of a step; sets outcome, step and time of the estimate.
  void take(std::int64_t step, const MeasurementSet& measurements, Estimate& estimate);
  const std::vector<int>& rows() const { return rows_; }  // ascending
  const Eigen::VectorXd& values() const { return y_; }    // of all rows of y
  std::int64_t refused_packets() const { return inbox_.refused_packets(); }

 private:
  PacketInbox inbox_;
  PacketChoice choice_;
  std::vector<int> rows_;
  Eigen::VectorXd y_;
};

/// Says in an estimate what one InputStateFilter knows. Inputs are published by the channels of the
/// plant; a channel that the mode does not list is zero for certain.
class InputStatePublisher {
 public:
  /// rule: of the filters whose estimates are published.
  InputStatePublisher(const ModeSet& modes, const InputStateRule& rule);

  /// Means, covariances, innovation N' r (white, chi-square by its covariance N' S N) of the filter
  /// after a step in a mode.
  void publish(const InputStateFilter& filter, int mode, std::int64_t step, Estimate& estimate);
  /// True when the output of every mode shows every input at once: then that of step k is published
  /// in step k, else that of the step before.
  bool is_direct() const { return is_direct_; }
  /// Input by the plant's channels, and its covariance, of one filter.
  void input_of(const InputStateFilter& filter, int mode, Eigen::VectorXd& mean,
                Eigen::MatrixXd& covariance) const;
  bool has_input(const InputStateFilter& filter) const;

 private:
  std::vector<std::vector<int>> channels_;  // of each mode
  int num_channels_;
  double input_variance_;
  bool is_direct_;
  InnovationRecord innovation_;
};

/// Multiple-model estimator of state, unknown inputs and mode (paper 004, Algorithm 2): a ModeBank
/// that takes one vector of Z_k in each step. Rows that do not arrive leave the vector.
///
/// mode_probability: mu, by the modes' order, none in the first step; hypotheses: each mode's
/// state. input_mean: by the plant's channels, zero in those that the mode does not list.
/// attack_probability: of the modes with channels, where some have none; else none is given.
class MultipleModel : public Estimator {
 public:
  /// rows[s]: rows of y that a packet of source s carries. Throws UsageError when modes, options
  /// and rows do not fit, or no filter exists in a mode.
  MultipleModel(const ModeSet& modes, const MultipleModelOptions& options,
                std::vector<std::vector<int>> rows);

  const Estimate& step(std::int64_t step, const MeasurementSet& measurements,
                       const Eigen::VectorXd& known_input) override;

  /// Packets refused since construction.
  std::int64_t refused_packets() const { return vector_.refused_packets(); }

 private:
  void publish(std::int64_t step);
  void mix();

  VectorOfRows vector_;
  ModeBank bank_;
  InputStatePublisher publisher_;
  MultipleModelOptions::Output output_;
  std::vector<char> is_attacked_;  // of each mode: it lists a channel
  bool tells_attack_, has_weighed_ = false;
  Eigen::VectorXd input_, apart_, input_apart_;
  Eigen::MatrixXd input_covariance_;
  Estimate estimate_;
};

}  // namespace holdfast
