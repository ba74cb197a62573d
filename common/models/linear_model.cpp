#include "common/models/linear_model.h"

#include <cmath>

namespace holdfast {
namespace {

using Rows = std::vector<std::vector<double>>;

Rows rows_of(const Eigen::MatrixXd& matrix) {
  Rows rows(static_cast<std::size_t>(matrix.rows()));
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) {
      rows[static_cast<std::size_t>(i)].push_back(matrix(i, j));
    }
  }
  return rows;
}

void read_matrix(ConfigurationMap& map, const char* key, Eigen::MatrixXd& matrix) {
  Rows rows = matrix.cols() == 0 ? Rows() : rows_of(matrix);
  map.read(key, rows, 0);
  if (!map.has(key)) return;
  const std::size_t num_columns = rows.empty() ? 0 : rows.front().size();
  matrix.resize(static_cast<Eigen::Index>(rows.size()), static_cast<Eigen::Index>(num_columns));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    for (std::size_t j = 0; j < num_columns; ++j) {
      matrix(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = rows[i][j];
    }
  }
}

void read_names(ConfigurationMap& map, const char* key, const char* stem, int count,
                std::vector<std::string>& names) {
  const auto size = static_cast<std::size_t>(count);
  if (!map.has(key) && names.size() != size) {
    names.clear();
    for (int i = 1; i <= count; ++i) names.push_back(std::string(stem) + std::to_string(i));
  }
  map.read(key, names);
  if (names.size() == size) return;
  map.problem(key,
              "must be " + std::to_string(count) + " names, not " + std::to_string(names.size()));
}

void read_all_names(ConfigurationMap& map, SystemModel& model) {
  read_names(map, "state_names", "x_", model.num_states(), model.state_names);
  read_names(map, "measurement_names", "y_", model.num_measurements(), model.measurement_names);
  read_names(map, "attack_names", "a_", model.num_attack_channels(), model.attack_names);
  if (model.num_inputs() > 0 || map.has("input_names")) {
    read_names(map, "input_names", "u_", model.num_inputs(), model.input_names);
  }
}

// Columns of channels: one of the two matrices may be left out for zeros, both for none.
void read_channels(ConfigurationMap& map, const char* state_key, Eigen::MatrixXd& of_state,
                   const char* reading_key, Eigen::MatrixXd& of_reading, const SystemModel& model) {
  read_matrix(map, state_key, of_state);
  read_matrix(map, reading_key, of_reading);
  if (of_state.size() == 0) of_state = Eigen::MatrixXd::Zero(model.A.rows(), of_reading.cols());
  if (of_reading.size() == 0) of_reading = Eigen::MatrixXd::Zero(model.C.rows(), of_state.cols());
}

}  // namespace

void read_linear_model(ConfigurationMap map, SystemModel& model) {
  map.read("step_s", model.step_s, kPositive);
  for (const auto& [key, matrix] : {std::pair{"A", &model.A}, std::pair{"C", &model.C},
                                    std::pair{"Q", &model.Q}, std::pair{"R", &model.R}}) {
    if (matrix->size() == 0) map.require(key);
    read_matrix(map, key, *matrix);
  }
  read_channels(map, "G", model.G, "H", model.H, model);
  if (model.num_inputs() > 0 || map.has("B") || map.has("D")) {
    read_channels(map, "B", model.B, "D", model.D, model);
  }
  for (const std::string& problem : model.problems()) map.problem(problem.substr(0, 1), problem);
  read_all_names(map, model);
}

void resolve_matrices(ConfigurationMap& map, const SystemModel& model) {
  ConfigurationMap matrices = map.map("matrices");
  for (const auto& [key, matrix] :
       {std::pair{"A", &model.A}, std::pair{"C", &model.C}, std::pair{"G", &model.G},
        std::pair{"H", &model.H}, std::pair{"Q", &model.Q}, std::pair{"R", &model.R},
        std::pair{"B", &model.B}, std::pair{"D", &model.D}}) {
    const bool is_of_inputs = matrix == &model.B || matrix == &model.D;
    if (is_of_inputs && model.num_inputs() == 0 && !matrices.has(key)) continue;
    const Eigen::MatrixXd derived = *matrix;
    Eigen::MatrixXd given = derived;
    read_matrix(matrices, key, given);
    // What another build derived may differ in its last digits.
    const bool is_same =
        (given.size() == 0 && derived.size() == 0) ||
        (given.rows() == derived.rows() && given.cols() == derived.cols() &&
         (given - derived).cwiseAbs().maxCoeff() <= 1e-9 * derived.cwiseAbs().maxCoeff());
    if (!is_same) matrices.problem(key, "follows from the model's other keys: leave it out");
  }
  SystemModel named = model;
  read_all_names(matrices, named);
  if (named.state_names != model.state_names ||
      named.measurement_names != model.measurement_names ||
      named.attack_names != model.attack_names || named.input_names != model.input_names) {
    matrices.problem("state_names", "names follow from the model's other keys: leave them out");
  }
}

}  // namespace holdfast
