#pragma once

#include <span>
#include <vector>

#include "estimators/estimate.h"
#include "estimators/kalman_core.h"
#include "estimators/packet_inbox.h"

namespace holdfast {

/// One hypothesis under correction: its belief, and how well the vector fitted it.
struct KalmanMode {
  KalmanCore* core;
  Gaussian* belief;
  double distance = 0.0;     // nu' S^-1 nu
  double log_density = 0.0;  // log N(nu; 0, S)
};

/// How a filter that wants one vector takes it from the packets of a source.
enum class PacketRule {
  kFirst,
  kLast,
  kMean,
  kNearest  // smallest nu' S^-1 nu
};

/// One vector out of Z_k: of each source a packet by rule, or the mean of its packets; and the
/// correction of one or more hypotheses by it, the same vector for all.
///
/// A gate leaves out packets with P(chi-square with the packet's rows <= nu' S^-1 nu) above a
/// probability. Rows without a packet are not in the vector. With several hypotheses a distance is
/// the smallest of theirs.
class PacketChoice {
 public:
  enum class Result {
    kNoPackets,
    kRefusedByGate,  // all of them; refused_score() says how far they were
    kFailed,         // an innovation covariance could not be factorised
    kCorrected
  };

  /// gate_probability 1: no gate. Throws UsageError when it is no probability above 0.
  PacketChoice(PacketRule rule, double gate_probability, const PacketInbox& inbox);

  /// Corrects all beliefs or, unless the result is kCorrected, none; a failure becomes the outcome
  /// of the estimate.
  Result correct(const PacketInbox& inbox, std::span<KalmanMode> modes, Estimate& estimate);

  /// Chooses the vector only. find_distances(packets of one source, their rows, distances): sets
  /// one distance per packet, or returns false, and then so does this. No rows: the gate left out
  /// all.
  template <class FindDistances>
  bool choose(const PacketInbox& inbox, const FindDistances& find_distances) {
    begin();
    for (int s = 0; s < inbox.num_sources(); ++s) {
      const std::span<const UsablePacket> packets = inbox.packets(s);
      if (packets.empty()) continue;
      distances_.assign(packets.size(), 0.0);
      if (needs_distances(packets.size()) &&
          !find_distances(packets, inbox.rows(s), std::span<double>(distances_))) {
        return false;
      }
      take(packets, inbox.rows(s), gates_[static_cast<std::size_t>(s)]);
    }
    return true;
  }

  /// The latest vector, and the rows of y that it has.
  const std::vector<int>& rows() const { return rows_; }
  const std::vector<double>& values() const { return values_; }
  /// Of the sources all whose packets the gate left out: the largest over sources of the chi-square
  /// probability of the nearest packet; 0 without such a source.
  double refused_score() const { return refused_score_; }

 private:
  void begin();
  bool needs_distances(std::size_t num_packets) const {
    return is_gated_ || (rule_ == PacketRule::kNearest && num_packets > 1);
  }
  void take(std::span<const UsablePacket> packets, const std::vector<int>& rows, double gate);

  PacketRule rule_;
  std::vector<double> gates_;  // of each source; infinite without a gate
  bool is_gated_;
  std::vector<double> distances_;
  std::vector<int> rows_;
  std::vector<double> values_;
  double refused_score_ = 0.0;
};

}  // namespace holdfast
