#include "estimators/hybrid_bernoulli_options.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <utility>

namespace holdfast {
namespace {

constexpr double kDefaultBox = 10.0;

Eigen::VectorXd vector_of(const std::vector<double>& values) {
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

std::vector<double> values_of(const Eigen::VectorXd& vector) {
  return {vector.data(), vector.data() + vector.size()};
}

// Keys mean, and covariance or std (a number or one per entry), of a Gaussian of this size.
void read_gaussian(ConfigurationMap& map, int size, Eigen::VectorXd& mean, Eigen::MatrixXd& P) {
  const auto entries = static_cast<std::size_t>(size);
  if (mean.size() != size) mean.setZero(size);
  if (P.rows() != size) P.setIdentity(size, size);
  std::vector<double> values = values_of(mean);
  map.read_shared("mean", values, entries);
  if (values.size() == entries) mean = vector_of(values);
  if (map.has("std")) {
    if (map.has("covariance")) map.problem("std", "give either std or covariance");
    std::vector<double> deviations(entries, 1.0);
    map.read_shared("std", deviations, entries, kPositive);
    if (deviations.size() == entries) P = vector_of(deviations).cwiseAbs2().asDiagonal();
    return;
  }
  std::vector<std::vector<double>> rows(entries);
  for (int i = 0; i < size; ++i) {
    for (int j = 0; j < size; ++j) rows[static_cast<std::size_t>(i)].push_back(P(i, j));
  }
  map.read("covariance", rows, entries);
  if (rows.size() != entries) return map.problem("covariance", "must be square, one row per mean");
  for (int i = 0; i < size; ++i) {
    const auto& row = rows[static_cast<std::size_t>(i)];
    if (row.size() == entries) P.row(i) = vector_of(row).transpose();
  }
}

AttackTerm standard_term(std::size_t channels) {
  const auto size = static_cast<Eigen::Index>(channels);
  return {1.0, Eigen::VectorXd::Zero(size), Eigen::MatrixXd::Identity(size, size)};
}

AttackModel all_channels(int num_channels) {
  AttackModel model;
  for (int c = 0; c < num_channels; ++c) model.channels.push_back(c);
  model.terms.push_back(standard_term(model.channels.size()));
  return model;
}

AttackModel read_attack_model(ConfigurationMap& map, const SystemModel& system, std::size_t index) {
  AttackModel model = all_channels(system.num_attack_channels());
  model.name = "attack_" + std::to_string(index + 1);
  map.read("name", model.name);
  map.read("probability", model.probability, kPositive);
  std::vector<double> channels(model.channels.begin(), model.channels.end());
  map.read("channels", channels, 0, {0.0, system.num_attack_channels() - 1.0});
  model.channels.assign(channels.begin(), channels.end());
  model.terms.clear();
  for (ConfigurationMap& item : map.maps("terms")) {
    AttackTerm term = standard_term(model.channels.size());
    item.read("weight", term.weight, kPositive);
    read_gaussian(item, static_cast<int>(model.channels.size()), term.mean, term.covariance);
    model.terms.push_back(std::move(term));
  }
  if (model.terms.empty()) model.terms.push_back(standard_term(model.channels.size()));
  return model;
}

void read_box(ConfigurationMap box, HybridBernoulliOptions& options, int num_measurements) {
  const auto size = static_cast<std::size_t>(num_measurements);
  std::vector<double> low = values_of(options.packet_box_low);
  std::vector<double> high = values_of(options.packet_box_high);
  box.read_shared("low", low, size);
  box.read_shared("high", high, size);
  if (low.size() == size) options.packet_box_low = vector_of(low);
  if (high.size() == size) options.packet_box_high = vector_of(high);
  using Outside = HybridBernoulliOptions::Outside;
  box.read_choice(
      "outside", options.outside,
      {{"constant", Outside::kConstant}, {"floor", Outside::kFloor}, {"zero", Outside::kZero}});
  box.read("floor", options.outside_floor, {0.0, 1.0, true});
}

bool is_positive_definite(const Eigen::MatrixXd& matrix, Eigen::Index size) {
  return matrix.rows() == size && matrix.cols() == size && matrix.isApprox(matrix.transpose()) &&
         Eigen::LLT<Eigen::MatrixXd>(matrix).info() == Eigen::Success;
}

void check_attack_models(const HybridBernoulliOptions& options, const SystemModel& system,
                         std::vector<std::string>& problems) {
  for (const AttackModel& model : options.attack_models) {
    const std::string where = "attack model '" + model.name + "': ";
    const auto size = static_cast<Eigen::Index>(model.channels.size());
    const bool is_ascending = std::adjacent_find(model.channels.begin(), model.channels.end(),
                                                 std::greater_equal<int>()) == model.channels.end();
    if (size == 0 || !is_ascending || model.channels.front() < 0 ||
        model.channels.back() >= system.num_attack_channels()) {
      problems.push_back(where + "channels must be ascending columns of G");
    }
    if (!(model.probability > 0.0)) problems.push_back(where + "probability must be positive");
    if (model.terms.empty()) problems.push_back(where + "at least one term is needed");
    for (const AttackTerm& term : model.terms) {
      if (!(term.weight > 0.0)) problems.push_back(where + "weights must be positive");
      if (term.mean.size() != size) problems.push_back(where + "mean needs one value per channel");
      if (!is_positive_definite(term.covariance, size)) {
        problems.push_back(where + "covariance must be positive definite, one row per channel");
      }
    }
  }
}

}  // namespace

void HybridBernoulliOptions::read(ConfigurationMap& map, const SystemModel& model) {
  *this = completed(model);
  map.read("birth_probability", birth_probability, kProbability);
  map.read("survival_probability", survival_probability, kProbability);
  std::string text;
  if (map.has("delivery_probability") && !map.scalar_text("delivery_probability", text)) {
    ConfigurationMap prior = map.map("delivery_probability");
    delivery_prior = BetaPrior{};
    prior.read("alpha", delivery_prior->alpha, kPositive);
    prior.read("beta", delivery_prior->beta, kPositive);
  } else {
    map.read("delivery_probability", delivery_probability, {0.0, 1.0, true});
  }
  map.read("delivery_memory", delivery_memory, {0.0, 1.0, true});
  map.read("substitution_probability", substitution_probability, kProbability);
  map.read_choice("correction", correction,
                  {{"auto", Correction::kAuto},
                   {"substitution", Correction::kSubstitution},
                   {"injection", Correction::kInjection}});
  map.read_choice("input_prior", input_prior,
                  {{"gaussian", InputPrior::kGaussian},
                   {"flat", InputPrior::kFlat},
                   {"paper", InputPrior::kPaper}});
  map.read("flat_log_density", flat_log_density);
  map.read_choice("feedthrough", feedthrough,
                  {{"auto", Feedthrough::kAuto},
                   {"direct", Feedthrough::kDirect},
                   {"delayed", Feedthrough::kDelayed}});
  std::vector<ConfigurationMap> items = map.maps("attack_models");
  if (!items.empty()) attack_models.clear();
  for (std::size_t i = 0; i < items.size(); ++i) {
    attack_models.push_back(read_attack_model(items[i], model, i));
  }
  map.read("attack_model_persistence", attack_model_persistence, kProbability);
  ConfigurationMap start = map.map("start");
  start.read("attack_probability", start_attack_probability, kProbability);
  read_gaussian(start, model.num_states(), start_mean, start_covariance);
  read_box(map.map("packet_box"), *this, model.num_measurements());
  map.read("prune_below", prune_below, {0.0, 0.5});
  map.read("merge_below", merge_below, kNonNegative);
  map.read_choice("merge_metric", merge_metric,
                  {{"own", MergeMetric::kOwn}, {"dominant", MergeMetric::kDominant}});
  map.read("components_max", components_max, {1.0, 1e4});
  map.read_choice("update", update,
                  {{"extended", Update::kExtended}, {"unscented", Update::kUnscented}});
  map.read_choice("state", state, {{"dominant", State::kDominant}, {"mean", State::kMean}});
  for (const std::string& text_of_problem : problems(model)) map.problem("", text_of_problem);
}

std::vector<std::string> HybridBernoulliOptions::problems(const SystemModel& model) const {
  const HybridBernoulliOptions all = completed(model);
  std::vector<std::string> found;
  const Eigen::Index n = model.num_states(), l = model.num_measurements();
  if (model.num_attack_channels() < 1) found.push_back("the model has no attack channel");
  check_attack_models(all, model, found);
  for (const double p : {birth_probability, survival_probability, substitution_probability,
                         start_attack_probability, attack_model_persistence}) {
    if (!kProbability.contains(p)) found.push_back("probabilities must be between 0 and 1");
  }
  if (!(delivery_probability > 0.0 && delivery_probability <= 1.0)) {
    found.push_back("delivery_probability must be above 0 and at most 1");
  }
  if (delivery_prior && !(delivery_prior->alpha > 0.0 && delivery_prior->beta > 0.0)) {
    found.push_back("delivery_probability: alpha and beta must be positive");
  }
  if (all.start_mean.size() != n) found.push_back("start: mean needs one value per state");
  if (!is_positive_definite(all.start_covariance, n)) {
    found.push_back("start: covariance must be positive definite, one row per state");
  }
  if (all.packet_box_low.size() != l || all.packet_box_high.size() != l ||
      !(all.packet_box_high.array() > all.packet_box_low.array()).all()) {
    found.push_back("packet_box: high must be above low, one of each per measurement or shared");
  }
  if (components_max < 1) found.push_back("components_max must be at least 1");
  if (input_prior != InputPrior::kGaussian && all.attack_models.size() > 1) {
    found.push_back("input_prior: flat and paper need a single attack model of all channels");
  }
  if (!model.is_linear() && input_prior != InputPrior::kGaussian) {
    found.push_back("input_prior: flat and paper need a linear model");
  }
  return found;
}

HybridBernoulliOptions HybridBernoulliOptions::completed(const SystemModel& model) const {
  HybridBernoulliOptions all = *this;
  const Eigen::Index n = model.num_states(), l = model.num_measurements();
  if (all.attack_models.empty()) {
    all.attack_models.push_back(all_channels(model.num_attack_channels()));
  }
  if (all.start_mean.size() == 0) all.start_mean.setZero(n);
  if (all.start_covariance.size() == 0) all.start_covariance.setIdentity(n, n);
  if (all.packet_box_low.size() == 0) all.packet_box_low.setConstant(l, -kDefaultBox);
  if (all.packet_box_high.size() == 0) all.packet_box_high.setConstant(l, kDefaultBox);
  return all;
}

}  // namespace holdfast
