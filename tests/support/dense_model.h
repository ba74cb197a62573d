#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "common/models/system_model.h"
#include "common/random_stream.h"

namespace holdfast::testing {

/// A stable linear model without a zero in A [n x n] or C [l x n], l <= n, drawn the same each
/// time.
inline SystemModel dense_model(int n, int l) {
  const RandomStream stream(1, 0, "test/dense_model");
  SystemModel model;
  model.A = 0.9 * Eigen::MatrixXd::Identity(n, n);
  model.C = Eigen::MatrixXd::Identity(l, n);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const auto draw = static_cast<std::uint64_t>(i * n + j);
      model.A(i, j) += 0.02 * stream.normal(1, draw);
      if (i < l) model.C(i, j) += 0.1 * stream.normal(2, draw);
    }
  }
  model.G = Eigen::MatrixXd::Zero(n, 0);
  model.H = Eigen::MatrixXd::Zero(l, 0);
  model.Q = 0.01 * Eigen::MatrixXd::Identity(n, n);
  model.R = 0.1 * Eigen::MatrixXd::Identity(l, l);
  return model;
}

}  // namespace holdfast::testing
