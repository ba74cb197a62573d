#include "estimators/multiple_model_options.h"

#include <algorithm>
#include <cmath>

namespace holdfast {
namespace {

void read_transition(ConfigurationMap& map, std::size_t num_modes, MultipleModelOptions& options) {
  map.read("stay_probability", options.stay_probability, kProbability);
  const auto count = static_cast<Eigen::Index>(num_modes);
  if (map.has("transition")) {
    if (map.has("stay_probability")) {
      map.problem("transition", "give stay_probability or transition, not both");
    }
    std::vector<std::vector<double>> rows;
    map.read("transition", rows, num_modes);
    if (rows.size() != num_modes) {
      return map.problem("transition",
                         "must have a row for each of the " + std::to_string(num_modes) + " modes");
    }
    options.bank.transition.resize(count, count);
    for (std::size_t i = 0; i < num_modes; ++i) {
      double sum = 0.0;
      for (std::size_t j = 0; j < std::min(num_modes, rows[i].size()); ++j) {
        options.bank.transition(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
            rows[i][j];
        sum += rows[i][j];
        if (!(rows[i][j] >= 0.0)) map.problem("transition", "must hold probabilities");
      }
      if (std::abs(sum - 1.0) > 1e-9) {
        map.problem("transition", "row " + std::to_string(i + 1) + " must sum to 1");
      }
    }
  } else if (options.stay_probability < 1.0 && num_modes > 1) {
    const double other = (1.0 - options.stay_probability) / static_cast<double>(num_modes - 1);
    options.bank.transition = Eigen::MatrixXd::Constant(count, count, other);
    options.bank.transition.diagonal().setConstant(options.stay_probability);
  }
}

}  // namespace

void read_rule(ConfigurationMap& map, InputStateRule& rule) {
  map.read_choice("likelihood", rule.likelihood,
                  {{"paper", InputLikelihood::kPaper},
                   {"ortho", InputLikelihood::kOrtho},
                   {"flat", InputLikelihood::kFlat},
                   {"evidence", InputLikelihood::kEvidence}});
  map.read("input_std", rule.input_std, kPositive);
  map.read("improve_input", rule.improves_input);
}

void read_unknown_input_vector(ConfigurationMap& map, VectorOptions& vector) {
  vector.packet = PacketRule::kFirst;
  vector.read(map);
  if (vector.packet == PacketRule::kNearest || vector.gate_probability < 1.0) {
    map.problem("packet",
                "which packet is near depends on inputs that are unknown here: use first, last or "
                "mean, and no gate");
  }
}

void MultipleModelOptions::read(ConfigurationMap& map, const ModeSet& modes) {
  using FloorRule = ModeBankOptions::FloorRule;
  const std::size_t num_modes = modes.modes.size();
  start.read(map.map("start"), modes.topologies.front().num_states());
  read_rule(map, bank.filter);
  read_transition(map, num_modes, *this);
  // Modes that can change are never lost for good, so that no floor has to keep them.
  if (bank.transition.size() > 0) bank.floor = 0.0;
  map.read("floor", bank.floor, {0.0, 1.0});
  if (bank.floor * static_cast<double>(num_modes) >= 1.0) {
    map.problem("floor", "must be below 1 / number of modes");
  }
  map.read_choice("floor_rule", bank.floor_rule,
                  {{"normalised", FloorRule::kNormalised}, {"printed", FloorRule::kPrinted}});
  if (map.has("start_probability")) {
    bank.start_probability.assign(num_modes, 0.0);
    map.read("start_probability", bank.start_probability, num_modes, kProbability);
    double sum = 0.0;
    for (const double probability : bank.start_probability) sum += probability;
    if (std::abs(sum - 1.0) > 1e-9) map.problem("start_probability", "must sum to 1");
  }
  map.read_choice("output", output,
                  {{"most_probable", Output::kMostProbable}, {"mixture", Output::kMixture}});
  read_unknown_input_vector(map, vector);
}

}  // namespace holdfast
