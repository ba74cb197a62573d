#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "common/models/system_model.h"

namespace holdfast {

/// One mode with its output split in two: what shows unknown inputs in the same step, and what is
/// free of them (paper 004, section III; method page "multiple_model", section 1).
///
/// Symbols: d [p] the unknown inputs, all attack channels of the mode; H = U1 Sigma V1', of rank
/// pH; z1 = T1 y [pH], z2 = T2 y [l - pH] with T1 R T2' = 0; d = V1 d1 + V2 d2; M1 = Sigma^-1.
struct DecoupledMode {
  Eigen::MatrixXd A, B, Q;
  Eigen::MatrixXd U2, V1, V2, T1, T2, M1;
  Eigen::MatrixXd C1, D1, R1, C2, D2, R2;
  Eigen::MatrixXd G1, G2;  // G V1, G V2
  Eigen::MatrixXd Ah;      // A - G1 M1 C1
  Eigen::MatrixXd E;       // G1 M1 R1 M1' G1' + Q
  double log_det_sigma = 0.0;
  std::vector<int> rows;     // of y, those that T1 and T2 take
  bool is_complete = false;  // all rows of the model

  int num_inputs() const { return static_cast<int>(V1.rows()); }
  int num_seen() const { return static_cast<int>(V1.cols()); }    // pH
  int num_hidden() const { return static_cast<int>(V2.cols()); }  // p - pH
  int num_free() const { return static_cast<int>(T2.rows()); }    // l - pH
};

/// Splits the given rows of y. Singular values of H below 1e-9 of the largest count as zero.
/// Precondition: the model is linear and has no problems(); rows ascend.
DecoupledMode decouple(const SystemModel& mode, std::span<const int> rows);

/// From one step's mode to the next one's: what the arithmetic of a step needs beside them.
struct ModeTransition {
  const DecoupledMode* from = nullptr;
  const DecoupledMode* to = nullptr;
  Eigen::MatrixXd F;  // C2 G2 of `from`, [l - pH x p - pH]
  Eigen::MatrixXd N;  // orthonormal basis of null(F')
  // Both steps have all rows and rank F = p - pH: hidden inputs follow from the readings alone.
  bool is_determined = false;
};

/// The modes must outlive the transition.
ModeTransition make_transition(const DecoupledMode& from, const DecoupledMode& to);

/// Inputs of `from` that not even the readings of the next step show, by channel, although they act
/// on the state or could: the null space of F has a part in them. Empty when the filter exists.
std::vector<int> undetermined_inputs(const ModeTransition& transition);

/// Singular values, largest first.
Eigen::VectorXd singular_values(const Eigen::MatrixXd& matrix);

}  // namespace holdfast
