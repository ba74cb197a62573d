#pragma once

#include "tests/unit/estimators/hybrid_bernoulli_laws/law_case.h"

namespace holdfast::testing {

/// n = m = 1, l = 2, two terms in the density of a. Injection: 2, 0, 1, 2 packets; substitution:
/// 1, 0, 1, 1.
LawCase scalar_case(bool is_direct, CorrectionLaw correction);

/// The same with two channels, of which an attack drives either the one or the other; while it goes
/// on, the same one with this probability and otherwise one drawn anew.
LawCase two_attacks_case(bool is_direct, CorrectionLaw correction, double persistence = 0.0);

/// The same with a beta prior of the delivery probability.
LawCase unknown_delivery_case(bool is_direct, CorrectionLaw correction);

/// The scalar system, R diagonal, with two sources of one row of y each: 2 + 1, 0 + 0, 1 + 0 and 1
/// + 2 packets.
LawCase partial_packets_case(bool is_direct);

/// The same with sources that carry both rows, or the second one: one node.
LawCase overlapping_sources_case(bool is_direct);

/// The scalar system with two channels that an attack drives together, of which y shows a sum.
LawCase rank_deficient_case();

/// A system drawn at random from a numbered stream: stable A, everything else standard normal,
/// two terms in the density of a when the number is odd; three steps with these numbers of packets
/// (one source, all rows) near to what the system would send.
LawCase random_case(std::uint32_t number, int n, int m, int l, bool is_direct,
                    CorrectionLaw correction, const std::vector<int>& num_packets);

/// The second column of H becomes half the first one: y shows a sum of the channels only.
/// Precondition: m = 2.
void make_rank_deficient(LawCase& law);

/// All at once: two channels of which y shows a sum, attacks of one or the other that tend to
/// stay, an unknown delivery probability, two nodes, three steps with up to two packets of each.
LawCase everything_case(bool is_direct);

}  // namespace holdfast::testing
