#include "tools/log_fit.h"

#include <yaml-cpp/yaml.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "common/configuration.h"
#include "common/log_file.h"
#include "estimators/attack_mixture.h"
#include "estimators/estimator_session.h"
#include "tools/experiment.h"
#include "tools/log_meta.h"
#include "tools/log_replay.h"

namespace holdfast {
namespace {

// Of a correlation's eigenvalues: in such a direction a fit would need 10^12 rounds to move.
constexpr double kSingularBelow = 1e-12;

std::vector<double> parameters_of(const AttackStatistics& statistics) {
  std::vector<double> parameters = {statistics.attack_probability, statistics.dos_probability,
                                    statistics.bias_probability,   statistics.scale_probability,
                                    statistics.scale_mean,         statistics.scale_std};
  const auto append = [&parameters](const auto& values) {
    parameters.insert(parameters.end(), values.data(), values.data() + values.size());
  };
  append(statistics.bias_mean);
  append(statistics.bias_covariance);
  return parameters;
}

double largest_change(const AttackStatistics& before, const AttackStatistics& after) {
  const std::vector<double> a = parameters_of(before), b = parameters_of(after);
  double largest = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    largest = std::max(largest, std::abs(a[i] - b[i]) / std::max(0.01, std::abs(b[i])));
  }
  return largest;
}

// Of a bias, what is believed to be exact though not all of it is.
void add_exact_parts(const Eigen::MatrixXd& covariance, std::vector<std::string>& keys) {
  std::vector<Eigen::Index> scattered;
  for (Eigen::Index i = 0; i < covariance.rows(); ++i) {
    if (covariance(i, i) > 0.0) {
      scattered.push_back(i);
    } else {
      const std::string row = "[" + std::to_string(i) + "]";
      keys.push_back("bias.mean" + row + " and .covariance" + row);
    }
  }
  if (scattered.empty()) return;
  const Eigen::VectorXd scale = covariance.diagonal()(scattered).cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd correlation =
      scale.asDiagonal() * covariance(scattered, scattered) * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(correlation, Eigen::EigenvaluesOnly);
  if (solver.eigenvalues()[0] < kSingularBelow)
    keys.emplace_back("bias.mean and .covariance across the directions in which they scatter");
}

}  // namespace

LogFitRound fit_log(const LogFitOptions& options) {
  const auto [meta, experiment] = read_logged_experiment(options.log_file);
  const EstimatorEntry& entry = experiment.estimator(options.name);
  if (entry.method != "attack_mixture" || entry.is_campaign_only()) {
    throw UsageError("estimator '" + entry.name +
                     "' has nothing to fit: name one of method attack_mixture");
  }
  const std::unique_ptr<Estimator> made =
      experiment.make_estimator(entry, static_cast<std::uint32_t>(meta.run));
  const auto& first = dynamic_cast<const AttackMixture&>(*made);
  if (first.believes_in_changes()) {
    throw UsageError("estimator '" + entry.name +
                     "' assumes changes with time (assumes.changes), and a fit gives one block for "
                     "the whole log");
  }
  std::vector<MeasurementSet> sets;
  for_each_set(
      options.program, options.log_file,
      [&sets](const MeasurementSet& set, const LogEvent& /*event*/) { sets.push_back(set); });
  LogFitRound round;
  AttackStatistics next = first.statistics();
  for (;; ++round.round) {
    round.statistics = next;
    const std::unique_ptr<AttackMixture> filter = first.renewed_for_fit(next);
    filter->remember(SmoothingEstimator::kAllSteps);
    EstimatorSession session(*filter, experiment.num_steps, experiment.step_s(),
                             experiment.known_inputs());
    for (const MeasurementSet& set : sets) session.on_set(set, [](const Estimate&) {});
    filter->smooth();
    round.log_likelihood = filter->log_likelihood();
    next = filter->fit();
    if (round.round == 0) round.unmoved = unmoved_beliefs(round.statistics, next);
    round.change = largest_change(round.statistics, next);
    round.is_converged = round.change < options.tolerance;
    if (options.on_round) options.on_round(round);
    if (round.is_converged || round.round == options.rounds_max) return round;
  }
}

std::vector<std::string> unmoved_beliefs(const AttackStatistics& guess,
                                         const AttackStatistics& next) {
  const auto is_certain = [](double probability) {
    return probability <= 0.0 || probability >= 1.0;
  };
  // Nothing is ever biased or scaled, so that nothing is learnt of it either.
  const bool never_falsified = guess.attack_probability <= 0.0 || guess.dos_probability >= 1.0;
  const bool stays_bias =
      guess.bias_mean == next.bias_mean && guess.bias_covariance == next.bias_covariance;
  const bool stays_scale = guess.scale_mean == next.scale_mean && guess.scale_std == next.scale_std;
  std::vector<std::string> keys;
  const auto add = [&keys](bool is_unmoved, const std::string& key) {
    if (is_unmoved) keys.push_back(key);
  };
  add(is_certain(guess.attack_probability), "attack_probability");
  add(is_certain(guess.dos_probability) || guess.attack_probability <= 0.0, "dos_probability");
  add(never_falsified || is_certain(guess.bias_probability), "bias.probability");
  add(stays_bias, "bias.mean and .covariance");
  if (!stays_bias) add_exact_parts(guess.bias_covariance, keys);
  add(never_falsified || is_certain(guess.scale_probability), "scale.probability");
  add(stays_scale, "scale.mean and .std");
  return keys;
}

std::string assumes_text(const AttackStatistics& statistics) {
  YAML::Emitter out;
  const auto texts = [](const auto& values) {
    std::vector<std::string> all;
    for (const double value : values) all.push_back(shortest_text(value));
    return all;
  };
  const auto rows = [&texts](const Eigen::MatrixXd& matrix) {
    std::vector<std::vector<std::string>> all;
    for (const auto& row : matrix.rowwise()) all.push_back(texts(row));
    return all;
  };
  out << YAML::Flow << YAML::BeginMap;
  out << YAML::Key << "attack_probability" << YAML::Value
      << shortest_text(statistics.attack_probability);
  out << YAML::Key << "dos_probability" << YAML::Value << shortest_text(statistics.dos_probability);
  out << YAML::Key << "bias" << YAML::Value << YAML::BeginMap;
  out << YAML::Key << "probability" << YAML::Value << shortest_text(statistics.bias_probability);
  out << YAML::Key << "mean" << YAML::Value << texts(statistics.bias_mean);
  out << YAML::Key << "covariance" << YAML::Value << rows(statistics.bias_covariance);
  out << YAML::EndMap << YAML::Key << "scale" << YAML::Value << YAML::BeginMap;
  out << YAML::Key << "probability" << YAML::Value << shortest_text(statistics.scale_probability);
  out << YAML::Key << "mean" << YAML::Value << shortest_text(statistics.scale_mean);
  out << YAML::Key << "std" << YAML::Value << shortest_text(statistics.scale_std);
  out << YAML::EndMap << YAML::EndMap;
  return std::string("assumes: ") + out.c_str() + "\n";
}

}  // namespace holdfast
