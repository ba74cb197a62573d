#pragma once

#include <Eigen/Core>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/catch.h"

namespace holdfast::testing {

/// A file below tests/golden.
inline nlohmann::json golden_file(const std::string& path) {
  std::ifstream stream(std::string(HOLDFAST_SOURCE_DIR) + "/tests/golden/" + path);
  REQUIRE(stream.good());
  return nlohmann::json::parse(stream);
}

inline Eigen::VectorXd vector_of(const nlohmann::json& values) {
  const auto numbers = values.get<std::vector<double>>();
  return Eigen::Map<const Eigen::VectorXd>(numbers.data(),
                                           static_cast<Eigen::Index>(numbers.size()));
}

inline Eigen::MatrixXd matrix_of(const nlohmann::json& rows) {
  Eigen::MatrixXd matrix(static_cast<Eigen::Index>(rows.size()),
                         static_cast<Eigen::Index>(rows.at(0).size()));
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    matrix.row(i) = vector_of(rows.at(static_cast<std::size_t>(i))).transpose();
  }
  return matrix;
}

}  // namespace holdfast::testing
