#include "tools/log_fit.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <holdfast/measurement_set_t.hpp>
#include <utility>
#include <vector>

#include "common/log_file.h"
#include "common/measurement_messages.h"
#include "estimators/attack_mixture.h"
#include "estimators/estimator_session.h"
#include "tools/experiment.h"
#include "tools/log_meta.h"
#include "tools/log_replay.h"

namespace holdfast {
namespace {

std::vector<MeasurementSet> read_sets(const std::string& log_file) {
  LogReader reader(log_file);
  LogEvent event;
  measurement_set_t message;
  std::vector<MeasurementSet> sets;
  while (reader.next(event)) {
    if (event.channel != "MEASUREMENT" || !decode_guarded(event.data, message)) continue;
    from_message(message, sets.emplace_back());
  }
  warn_of_damage("holdfast-smoother", log_file, reader);
  if (sets.empty()) throw UsageError(log_file + ": holds no measurement set");
  return sets;
}

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
  const std::vector<MeasurementSet> sets = read_sets(options.log_file);
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
    round.change = largest_change(round.statistics, next);
    round.is_converged = round.change < options.tolerance;
    if (options.on_round) options.on_round(round);
    if (round.is_converged || round.round == options.rounds_max) return round;
  }
}

std::vector<std::string> unmoved_beliefs(const AttackStatistics& statistics) {
  const std::pair<const char*, double> all[] = {
      {"attack_probability", statistics.attack_probability},
      {"dos_probability", statistics.dos_probability},
      {"bias.probability", statistics.bias_probability},
      {"scale.probability", statistics.scale_probability}};
  std::vector<std::string> names;
  for (const auto& [name, probability] : all) {
    if (probability <= 0.0 || probability >= 1.0) names.emplace_back(name);
  }
  return names;
}

std::string assumes_text(const AttackStatistics& statistics) {
  YAML::Emitter out;
  const auto rows = [](const Eigen::MatrixXd& matrix) {
    std::vector<std::vector<double>> all;
    for (const auto& row : matrix.rowwise()) all.emplace_back(row.begin(), row.end());
    return all;
  };
  out.SetDoublePrecision(6);
  out << YAML::Flow << YAML::BeginMap;
  out << YAML::Key << "attack_probability" << YAML::Value << statistics.attack_probability;
  out << YAML::Key << "dos_probability" << YAML::Value << statistics.dos_probability;
  out << YAML::Key << "bias" << YAML::Value << YAML::BeginMap;
  out << YAML::Key << "probability" << YAML::Value << statistics.bias_probability;
  out << YAML::Key << "mean" << YAML::Value
      << std::vector<double>(statistics.bias_mean.begin(), statistics.bias_mean.end());
  out << YAML::Key << "covariance" << YAML::Value << rows(statistics.bias_covariance);
  out << YAML::EndMap << YAML::Key << "scale" << YAML::Value << YAML::BeginMap;
  out << YAML::Key << "probability" << YAML::Value << statistics.scale_probability;
  out << YAML::Key << "mean" << YAML::Value << statistics.scale_mean;
  out << YAML::Key << "std" << YAML::Value << statistics.scale_std;
  out << YAML::EndMap << YAML::EndMap;
  return std::string("assumes: ") + out.c_str() + "\n";
}

}  // namespace holdfast
