#include "estimators/binary_likelihood.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace holdfast {
namespace {

// Above, squares of the reading overflow; no channel of a gain near one gives such a value.
constexpr double kReadingMax = 1e100;
constexpr double kBitTolerance = 1e-9;
// A factor a + b q loses log10(1 / smaller end) digits, so ends below go through logarithms.
constexpr double kLinearMinExact = 1e-3;
// 16 factors x DetectionTable::kErrorMax / 0.05 = 6.4e-9.
constexpr double kLinearMinTable = 0.05;
constexpr double kLogMin = -575.0;  // log(1e-250)
// 1e-3 to this power is still a normal number.
constexpr std::size_t kLinearFactorsMax = 96;

double log_add(double a, double b) {
  const double larger = std::max(a, b);
  if (std::isinf(larger)) return larger;
  return larger + std::log1p(std::exp(std::min(a, b) - larger));
}

double value_or_zero(const std::vector<double>& values, std::size_t i) {
  return values.empty() ? 0.0 : values.at(i);
}

}  // namespace

BinaryLikelihood::BinaryLikelihood(const BinaryTargetModel& model,
                                   const BinaryTargetModel::Attack& assumed,
                                   DuplicateRule duplicates, bool uses_table,
                                   const ParticleKernel& kernel)
    : model_(model),
      duplicates_(duplicates),
      kernel_(kernel),
      law_(make_detection_law(model)),
      linear_min_(uses_table ? kLinearMinTable : kLinearMinExact),
      group_of_sensor_(model.num_sensors(), -1) {
  if (uses_table) table_ = std::make_unique<DetectionTable>(law_);
  const double T = model.threshold;
  const double a = assumed.deception_low, b = assumed.deception_high;
  const double q_mu = b > a ? std::clamp((b - T) / (b - a), 0.0, 1.0) : (a > T ? 1.0 : 0.0);
  const double not_q_mu = b > a ? std::clamp((T - a) / (b - a), 0.0, 1.0) : 1.0 - q_mu;
  const double zero_exceeds = 0.0 > T ? 1.0 : 0.0;  // eq. (5) is strict
  for (std::size_t s = 0; s < model.num_sensors(); ++s) {
    const double phi = value_or_zero(assumed.dos, s);
    const double varphi = value_or_zero(assumed.deception, s);
    const double alpha = value_or_zero(assumed.flip, s);
    const double read_one_at_miss = (1.0 - phi) * varphi * q_mu + phi * zero_exceeds;
    const double read_zero_at_hit = (1.0 - phi) * varphi * not_q_mu + phi * (1.0 - zero_exceeds);
    const double untouched = (1.0 - phi) * (1.0 - varphi);
    const double read_zero_at_miss = untouched + read_zero_at_hit;
    const double read_one_at_hit = untouched + read_one_at_miss;
    const auto flipped = [alpha](double same, double other) {
      return std::log((1.0 - alpha) * same + alpha * other);
    };
    sensors_.push_back(
        {flipped(read_one_at_miss, read_zero_at_miss), flipped(read_zero_at_miss, read_one_at_miss),
         flipped(read_one_at_hit, read_zero_at_hit), flipped(read_zero_at_hit, read_one_at_hit),
         std::log(untouched * (1.0 - alpha))});
  }
}

bool BinaryLikelihood::make_term(const Sensor& sensor, double value, Term& term) const {
  if (!std::isfinite(value)) return false;
  double log_one = 0.0, log_zero = 0.0;  // densities of the value given the bit
  if (model_.has_radio_channel) {
    if (std::abs(value) > kReadingMax) return false;
    const double variance = model_.radio_noise_std * model_.radio_noise_std;
    // Relative to the larger density, since the difference of two large squares would cost digits.
    const double ratio = model_.radio_gain * (value - 0.5 * model_.radio_gain) / variance;
    (ratio > 0.0 ? log_zero : log_one) = -std::abs(ratio);
    const double distance = ratio > 0.0 ? value - model_.radio_gain : value;
    term.constant = -0.5 * distance * distance / variance -
                    std::log(model_.radio_noise_std * std::sqrt(2.0 * std::numbers::pi));
  } else if (std::abs(value - 1.0) <= kBitTolerance) {
    log_zero = -HUGE_VAL;
  } else if (std::abs(value) <= kBitTolerance) {
    log_one = -HUGE_VAL;
  } else {
    return false;
  }
  term.hit = log_add(log_one + sensor.log_one_at_hit, log_zero + sensor.log_zero_at_hit);
  term.miss = log_add(log_one + sensor.log_one_at_miss, log_zero + sensor.log_zero_at_miss);
  term.authentic_hit = log_one + sensor.log_authentic;
  term.authentic_miss = log_zero + sensor.log_authentic;
  return true;
}

std::int32_t BinaryLikelihood::add_to_group(std::size_t sensor, const Term& term) {
  std::int32_t& group = group_of_sensor_[sensor];
  if (group < 0 || duplicates_ == DuplicateRule::kProduct) {
    group = static_cast<std::int32_t>(groups_.size());
    groups_.push_back(term);
    sensor_of_group_.push_back(sensor);
    return group;
  }
  Term& sum = groups_[static_cast<std::size_t>(group)];
  if (duplicates_ == DuplicateRule::kFirst) return -1;
  if (duplicates_ == DuplicateRule::kLast) {
    sum = term;
    return group;
  }
  const double shift = term.constant - sum.constant;
  sum.hit = log_add(sum.hit, term.hit + shift);
  sum.miss = log_add(sum.miss, term.miss + shift);
  sum.count += 1.0;
  return group;
}

BinaryLikelihood::Reception BinaryLikelihood::set_measurements(const MeasurementSet& measurements) {
  Reception reception;
  std::fill(group_of_sensor_.begin(), group_of_sensor_.end(), -1);
  groups_.clear();
  sensor_of_group_.clear();
  packets_.clear();
  for (const Packet& packet : measurements.packets) {
    PacketTerm& entry = packets_.emplace_back();
    const auto sensor = static_cast<std::size_t>(packet.source);
    const bool is_taken =
        packet.source >= 0 && sensor < sensors_.size() && packet.num_values == 1 &&
        make_term(sensors_[sensor], measurements.values_of(packet)[0], entry.term);
    if (!is_taken) {
      ++reception.num_refused;
      continue;
    }
    ++reception.num_used;
    entry.group = add_to_group(sensor, entry.term);
  }
  if (duplicates_ == DuplicateRule::kLast) {
    // Only the last packet of a group counts; those before it are as good as absent.
    for (auto packet = packets_.rbegin(); packet != packets_.rend(); ++packet) {
      if (packet->group < 0) continue;
      std::int32_t& open =
          group_of_sensor_[sensor_of_group_[static_cast<std::size_t>(packet->group)]];
      if (open < 0) packet->group = -1;
      open = -1;
    }
  }
  make_factors();
  return reception;
}

void BinaryLikelihood::make_factors() {
  factors_.clear();
  row_of_group_.assign(groups_.size(), -1);
  num_linear_ = num_log_ = 0;
  log_constant_ = 0.0;
  enum class Form { kLinear, kLog, kTwoLog };
  for (const Form form : {Form::kLinear, Form::kLog, Form::kTwoLog}) {
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      if (row_of_group_[g] >= 0) continue;
      const Term& term = groups_[g];
      const double larger = std::max(term.hit, term.miss);
      const double smaller = std::min(term.hit, term.miss) - larger;
      const bool is_possible = larger > -HUGE_VAL;
      if (form == Form::kLinear &&
          !(is_possible && smaller >= std::log(linear_min_) && num_linear_ < kLinearFactorsMax)) {
        continue;
      }
      if (form == Form::kLog && !(is_possible && smaller >= kLogMin)) continue;
      num_linear_ += form == Form::kLinear ? 1 : 0;
      num_log_ += form == Form::kLog ? 1 : 0;
      row_of_group_[g] = static_cast<std::int32_t>(factors_.size());
      const auto& position = model_.sensor_positions_m[sensor_of_group_[g]];
      LikelihoodFactor& factor = factors_.emplace_back();
      factor.sensor_x_m = position[0];
      factor.sensor_y_m = position[1];
      factor.log_at_hit = is_possible ? term.hit - larger : -HUGE_VAL;
      factor.log_at_miss = is_possible ? term.miss - larger : -HUGE_VAL;
      factor.at_hit = std::exp(factor.log_at_hit);
      factor.at_miss = std::exp(factor.log_at_miss);
      log_constant_ += larger + term.constant - std::log(term.count);
    }
  }
}

LikelihoodProblem BinaryLikelihood::problem(bool as_log, double* q) const {
  LikelihoodProblem problem;
  problem.law = &law_;
  problem.table = table_ ? &table_->view() : nullptr;
  problem.factors = factors_.data();
  problem.num_linear = num_linear_;
  problem.num_log = num_log_;
  problem.num_two_log = factors_.size() - num_linear_ - num_log_;
  problem.as_log = as_log;
  problem.q = q;
  return problem;
}

void BinaryLikelihood::likelihood(const ParticleSet& particles, double* out, double* q) const {
  kernel_.weigh(problem(false, q), particles.x(), particles.y(), out, particles.padded());
}

void BinaryLikelihood::log_likelihood(const ParticleSet& particles, double* out, double* q) const {
  kernel_.weigh(problem(true, q), particles.x(), particles.y(), out, particles.padded());
}

double BinaryLikelihood::authentic_probability(std::size_t packet, const double* weights,
                                               const double* q, std::size_t padded) const {
  const PacketTerm& entry = packets_.at(packet);
  if (entry.group < 0) return 0.0;
  const auto group = static_cast<std::size_t>(entry.group);
  const Term& sum = groups_[group];
  const double larger = std::max(sum.hit, sum.miss);
  if (!(larger > -HUGE_VAL)) return 0.0;
  const double shift = entry.term.constant - sum.constant - larger;
  AuthenticRatio ratio;
  ratio.hit = std::exp(entry.term.authentic_hit + shift);
  ratio.miss = std::exp(entry.term.authentic_miss + shift);
  ratio.all_hit = std::exp(sum.hit - larger);
  ratio.all_miss = std::exp(sum.miss - larger);
  // Equal for every particle, among others when no attack is assumed; then the sum over particles
  // would meet 0 / 0 where 1 - q vanishes.
  const double cross = ratio.hit * ratio.all_miss, other_cross = ratio.miss * ratio.all_hit;
  if (std::abs(cross - other_cross) <= 1e-14 * std::max(cross, other_cross)) {
    return ratio.all_hit > ratio.all_miss ? ratio.hit / ratio.all_hit : ratio.miss / ratio.all_miss;
  }
  const double* row = q + static_cast<std::size_t>(row_of_group_[group]) * padded;
  return std::clamp(kernel_.authentic(ratio, row, weights, padded), 0.0, 1.0);
}

}  // namespace holdfast
