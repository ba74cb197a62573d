#pragma once

#include <numeric>
#include <vector>

#include "estimators/mode_bank.h"
#include "tests/support/golden.h"

namespace holdfast::testing {

/// A matrix of the vectors; an empty one has lost its shape on the way.
inline Eigen::MatrixXd shaped(const nlohmann::json& rows, Eigen::Index num_rows,
                              Eigen::Index num_columns) {
  if (num_rows == 0 || num_columns == 0) return Eigen::MatrixXd::Zero(num_rows, num_columns);
  return matrix_of(rows);
}

/// One mode of the vectors.
inline SystemModel mode_of(const nlohmann::json& system) {
  SystemModel model;
  model.A = matrix_of(system.at("A"));
  model.C = matrix_of(system.at("C"));
  model.Q = matrix_of(system.at("Q"));
  model.R = matrix_of(system.at("R"));
  const auto columns_of = [](const nlohmann::json& rows) {
    return rows.empty() ? Eigen::Index{0} : static_cast<Eigen::Index>(rows.at(0).size());
  };
  const Eigen::Index n = model.A.rows(), l = model.C.rows();
  const Eigen::Index p = columns_of(system.at("G")), m = columns_of(system.at("B"));
  model.G = shaped(system.at("G"), n, p);
  model.H = shaped(system.at("H"), l, p);
  if (m > 0) {
    model.B = shaped(system.at("B"), n, m);
    model.D = shaped(system.at("D"), l, m);
  }
  return model;
}

inline std::vector<int> all_rows(const SystemModel& model) {
  std::vector<int> rows(static_cast<std::size_t>(model.num_measurements()));
  std::iota(rows.begin(), rows.end(), 0);
  return rows;
}

inline Eigen::VectorXd vector_or_none(const nlohmann::json& values) {
  return values.empty() ? Eigen::VectorXd() : vector_of(values);
}

/// Largest difference, relative to the largest element of what is wanted, or to 0.001 if that is
/// less.
inline double difference(const Eigen::MatrixXd& value, const Eigen::MatrixXd& wanted) {
  REQUIRE(value.rows() == wanted.rows());
  REQUIRE(value.cols() == wanted.cols());
  if (wanted.size() == 0) return 0.0;
  return (value - wanted).cwiseAbs().maxCoeff() / std::max(1e-3, wanted.cwiseAbs().maxCoeff());
}

}  // namespace holdfast::testing
