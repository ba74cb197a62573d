#include "estimators/packet_choice.h"

#include <algorithm>
#include <limits>

#include "common/chi_square.h"
#include "common/errors.h"

namespace holdfast {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

PacketChoice::PacketChoice(PacketRule rule, double gate_probability, const PacketInbox& inbox)
    : rule_(rule), is_gated_(gate_probability < 1.0) {
  if (!(gate_probability > 0.0 && gate_probability <= 1.0)) {
    throw UsageError("gate_probability must be above 0 and at most 1");
  }
  for (int s = 0; s < inbox.num_sources(); ++s) {
    gates_.push_back(
        gate_probability < 1.0
            ? chi_square_quantile(gate_probability, static_cast<double>(inbox.rows(s).size()))
            : kInfinity);
  }
}

PacketChoice::Result PacketChoice::correct(const PacketInbox& inbox, std::span<KalmanMode> modes,
                                           Estimate& estimate) {
  if (inbox.num_usable() == 0) return Result::kNoPackets;
  for (const KalmanMode& mode : modes) mode.core->observe(*mode.belief);
  const bool is_chosen =
      choose(inbox, [modes](std::span<const UsablePacket> packets, const std::vector<int>& rows,
                            std::span<double> distances) {
        std::fill(distances.begin(), distances.end(), kInfinity);
        for (const KalmanMode& mode : modes) {
          if (!mode.core->use_rows(rows)) return false;
          for (std::size_t p = 0; p < packets.size(); ++p) {
            distances[p] = std::min(distances[p], mode.core->innovate(packets[p].values));
          }
        }
        return true;
      });
  if (is_chosen && rows_.empty()) return Result::kRefusedByGate;
  if (!is_chosen || !std::all_of(modes.begin(), modes.end(), [this](const KalmanMode& mode) {
        return mode.core->use_rows(rows_);
      })) {
    estimate.outcome = StepOutcome::kFactorisationFailed;
    return Result::kFailed;
  }
  for (KalmanMode& mode : modes) {
    mode.distance = mode.core->innovate(values_);
    mode.log_density = mode.core->log_density(mode.distance);
    mode.core->correct(*mode.belief);
  }
  return Result::kCorrected;
}

void PacketChoice::begin() {
  rows_.clear();
  values_.clear();
  refused_score_ = 0.0;
}

void PacketChoice::take(std::span<const UsablePacket> packets, const std::vector<int>& rows,
                        double gate) {
  const std::size_t begin = values_.size();
  double num_taken = 0.0, nearest = kInfinity;
  for (std::size_t p = 0; p < packets.size(); ++p) {
    const double distance = distances_[p];
    const bool is_nearer = distance < nearest;
    nearest = std::min(nearest, distance);
    if (distance > gate) continue;
    const std::span<const double> values = packets[p].values;
    if (num_taken == 0.0) {
      values_.insert(values_.end(), values.begin(), values.end());
    } else if (rule_ == PacketRule::kMean) {
      for (std::size_t i = 0; i < values.size(); ++i) values_[begin + i] += values[i];
    } else if (rule_ == PacketRule::kLast || (rule_ == PacketRule::kNearest && is_nearer)) {
      std::copy(values.begin(), values.end(), values_.begin() + static_cast<std::ptrdiff_t>(begin));
    }
    num_taken += 1.0;
  }
  if (num_taken == 0.0) {
    refused_score_ = std::max(refused_score_,
                              chi_square_distribution(nearest, static_cast<double>(rows.size())));
    return;
  }
  rows_.insert(rows_.end(), rows.begin(), rows.end());
  if (rule_ != PacketRule::kMean) return;
  for (std::size_t i = begin; i < values_.size(); ++i) values_[i] /= num_taken;
}

}  // namespace holdfast
