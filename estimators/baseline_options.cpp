#include "estimators/baseline_options.h"

#include <Eigen/Eigenvalues>
#include <algorithm>

#include "common/errors.h"
#include "common/random_stream.h"

namespace holdfast {
namespace {

constexpr Interval kAboveZeroProbability{0.0, 1.0, true};

void read_start(ConfigurationMap& map, const SystemModel& model, GaussianOptions& start) {
  start.read(map.map("start"), model.num_states());
}

void read_attack(ConfigurationMap& map, const SystemModel& model, GaussianOptions& prior,
                 Feedthrough& feedthrough) {
  prior.read(map.map("attack_prior"), model.num_attack_channels());
  map.read_choice("feedthrough", feedthrough,
                  {{"auto", Feedthrough::kAuto},
                   {"direct", Feedthrough::kDirect},
                   {"delayed", Feedthrough::kDelayed}});
}

}  // namespace

void GaussianOptions::read(ConfigurationMap map, int size) {
  const auto count = static_cast<std::size_t>(size);
  if (mean.empty()) mean.assign(count, 0.0);
  if (std.size() == 1) std.assign(count, std[0]);
  map.read_shared("mean", mean, count);
  if (map.has("covariance")) {
    map.read("covariance", covariance, count);
    if (map.has("std")) map.problem("std", "give std or covariance, not both");
    if (covariance.size() != count) {
      map.problem("covariance", "must have " + std::to_string(count) + " rows");
      return;
    }
    try {
      gaussian(size);
    } catch (const UsageError& error) {
      map.problem("covariance", error.what());
    }
  } else {
    map.read_shared("std", std, count, kNonNegative);
  }
}

Gaussian GaussianOptions::gaussian(int size) const {
  const auto count = static_cast<std::size_t>(size);
  if ((!mean.empty() && mean.size() != count) || (std.size() != 1 && std.size() != count) ||
      (!covariance.empty() && covariance.size() != count)) {
    throw UsageError("a mean, std or covariance needs " + std::to_string(count) + " components");
  }
  Gaussian result{Eigen::VectorXd::Zero(size), Eigen::MatrixXd::Zero(size, size)};
  if (!mean.empty()) result.mean = Eigen::Map<const Eigen::VectorXd>(mean.data(), size);
  for (std::size_t i = 0; i < count; ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    if (covariance.empty()) {
      const double value = std.size() == 1 ? std[0] : std[i];
      result.covariance(row, row) = value * value;
      continue;
    }
    if (covariance[i].size() != count) throw UsageError("a covariance must be square");
    result.covariance.row(row) = Eigen::Map<const Eigen::RowVectorXd>(covariance[i].data(), size);
  }
  if (size == 0) return result;
  const Eigen::MatrixXd& P = result.covariance;
  const double scale = P.cwiseAbs().maxCoeff();
  if (!result.mean.allFinite() || !P.allFinite()) throw UsageError("a Gaussian must be finite");
  if ((P - P.transpose()).cwiseAbs().maxCoeff() > 1e-12 * scale) {
    throw UsageError("a covariance must be symmetric");
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(P, Eigen::EigenvaluesOnly);
  if (eigen.eigenvalues().minCoeff() < -1e-12 * scale) {
    throw UsageError("a covariance must be positive semidefinite");
  }
  return result;
}

void PacketBoxOptions::read(ConfigurationMap map, int num_measurements) {
  const auto count = static_cast<std::size_t>(num_measurements);
  map.require("low");
  map.require("high");
  low.resize(count, 0.0);
  high.resize(count, 1.0);
  map.read_shared("low", low, count);
  map.read_shared("high", high, count);
  for (std::size_t i = 0; i < std::min(low.size(), high.size()); ++i) {
    if (low[i] < high[i]) continue;
    map.problem("high", "must be above low in every row");
    return;
  }
}

void VectorOptions::read(ConfigurationMap& map) {
  map.read_choice("packet", packet,
                  {{"first", PacketRule::kFirst},
                   {"last", PacketRule::kLast},
                   {"mean", PacketRule::kMean},
                   {"nearest", PacketRule::kNearest}});
  map.read("gate_probability", gate_probability, kAboveZeroProbability);
}

void VectorFilterOptions::read(ConfigurationMap& map, const SystemModel& model) {
  ConfigurationMap start_map = map.map("start");
  start.read(start_map, model.num_states());
  start_map.read("step", start_step, {0.0, 1.0});
  start_map.read("drawn", start_is_drawn);
  vector.read(map);
  map.read_choice("linearisation", linearisation,
                  {{"extended", Linearisation::kExtended},
                   {"unscented", Linearisation::kUnscented},
                   {"cubature", Linearisation::kCubature}});
}

GaussianOptions VectorFilterOptions::start_of_run(int num_states, std::uint64_t seed,
                                                  std::uint32_t run) const {
  if (!start_is_drawn) return start;
  const RandomStream stream(seed, run, "estimator/start");
  const Gaussian around = start.gaussian(num_states);
  Eigen::VectorXd drawn(num_states);
  for (int i = 0; i < num_states; ++i) drawn[i] = stream.normal(0, static_cast<std::uint64_t>(i));
  // A covariance may be singular, which rules Cholesky out.
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(around.covariance);
  drawn = around.mean +
          eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().cwiseProduct(drawn);
  GaussianOptions result = start;
  result.mean.assign(drawn.begin(), drawn.end());
  return result;
}

void KalmanFilterOptions::read(ConfigurationMap& map, const SystemModel& model) {
  VectorFilterOptions::read(map, model);
  map.read("skip_zero", skip_zero);
}

void ProbabilisticDataAssociationOptions::read(ConfigurationMap& map, const SystemModel& model) {
  read_start(map, model, start);
  map.read_or_same("delivery_probability", delivery_probability, kAboveZeroProbability);
  packet_box.read(map.map("packet_box"), model.num_measurements());
}

void JointInputStateOptions::read(ConfigurationMap& map, const SystemModel& model) {
  read_start(map, model, start);
  read_attack(map, model, attack_prior, feedthrough);
  vector.read(map);
}

void InteractingMultipleModelOptions::read(ConfigurationMap& map, const SystemModel& model) {
  ConfigurationMap start_map = map.map("start");
  start.read(start_map, model.num_states());
  start_map.read("attack_probability", start_attack_probability, kProbability);
  read_attack(map, model, attack_prior, feedthrough);
  map.read("birth_probability", birth_probability, kProbability);
  map.read("survival_probability", survival_probability, kProbability);
  map.read_choice("packets", packets, {{"choice", Packets::kChoice}, {"all", Packets::kAll}});
  if (packets == Packets::kChoice) {
    vector.read(map);
  } else {
    map.read_or_same("delivery_probability", delivery_probability, kAboveZeroProbability);
    packet_box.read(map.map("packet_box"), model.num_measurements());
  }
}

}  // namespace holdfast
