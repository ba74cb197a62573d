// Posteriors of packets of several nodes: each is given all packets of the step, whichever comes
// first, and whatever reduction does between the nodes.

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "tests/support/catch.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/filter_route.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/law_cases.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/sequence_enumeration.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

constexpr int kNumNodes = 3;

// One row of y per node; packets of all nodes, mixed, whose numbers differ by node and step.
LawCase three_nodes(bool is_direct, const std::vector<int>& num_packets) {
  LawCase law = random_case(6, 3, 2, kNumNodes, is_direct, kInjection, num_packets);
  law.model.R = Eigen::MatrixXd(law.model.R.diagonal().asDiagonal());
  law.rows = {{0}, {1}, {2}};
  for (LawStep& step : law.steps) {
    const std::vector<LawPacket> whole = step.packets;
    step.packets.clear();
    for (std::size_t p = 0; p < whole.size(); ++p) {
      for (int node = 0; node < kNumNodes; ++node) {
        if (p > 0 && node == 1) continue;
        step.packets.push_back({whole[p].y.segment(node, 1), node});
      }
    }
  }
  return law;
}

// Row and source i are what order[i] was: nodes are corrected in this order.
LawCase in_order(const LawCase& law, const std::vector<int>& order) {
  LawCase other = law;
  other.model.C = law.model.C(order, Eigen::all);
  other.model.H = law.model.H(order, Eigen::all);
  other.model.R = law.model.R(order, order);
  other.box_low = law.box_low(order);
  other.box_high = law.box_high(order);
  for (LawStep& step : other.steps) {
    for (LawPacket& packet : step.packets) {
      const auto found = std::find(order.begin(), order.end(), packet.source);
      packet.source = static_cast<int>(found - order.begin());
    }
  }
  return other;
}

// What one node's packets were given before those of any other are seen.
std::vector<double> judged_alone(const LawCase& law, int node) {
  LawStep step = law.steps[0];
  const auto is_other = [&](const LawPacket& packet) { return packet.source != node; };
  step.packets.erase(std::remove_if(step.packets.begin(), step.packets.end(), is_other),
                     step.packets.end());
  return FilterRoute(law).step(step).packet_probability;
}

std::vector<double> those_of_node(const std::vector<double>& all, const LawStep& step, int node) {
  std::vector<double> result;
  for (std::size_t p = 0; p < step.packets.size(); ++p) {
    if (step.packets[p].source == node) result.push_back(all[p]);
  }
  return result;
}

double largest_difference(const std::vector<double>& a, const std::vector<double>& b) {
  REQUIRE(a.size() == b.size());
  double largest = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = worse(std::abs(a[i] - b[i]), largest);
  return largest;
}

double largest_sum_of_node(const std::vector<double>& all, const LawStep& step) {
  double largest = 0.0;
  for (int node = 0; node < kNumNodes; ++node) {
    const std::vector<double> own = those_of_node(all, step, node);
    CHECK(std::all_of(own.begin(), own.end(), [](double p) { return p >= 0.0 && p <= 1.0; }));
    largest = worse(std::accumulate(own.begin(), own.end(), 0.0), largest);
  }
  return largest;
}

}  // namespace

TEST_CASE("the order of nodes changes no packet's posterior") {
  const bool is_direct = GENERATE(true, false);
  const bool is_delivery_unknown = GENERATE(true, false);
  LawCase law = three_nodes(is_direct, {2, 1});  // a third step would have too many components
  if (is_delivery_unknown) law.delivered_count = 3.0, law.lost_count = 1.5;
  law.steps[1].packets.pop_back();  // a node without packets
  std::vector<int> order(kNumNodes);
  std::iota(order.begin(), order.end(), 0);
  while (std::next_permutation(order.begin(), order.end())) {
    FilterRoute filter(law);
    const LawCase turned = in_order(law, order);
    FilterRoute other(turned);
    for (std::size_t k = 0; k < law.steps.size(); ++k) {
      const LawPosterior one = filter.step(law.steps[k]), two = other.step(turned.steps[k]);
      CHECK(largest_difference(one.packet_probability, two.packet_probability) < 1e-9);
    }
  }
}

TEST_CASE("packets of the last node change what is thought of those of the first") {
  const bool is_direct = GENERATE(true, false);
  const LawCase law = three_nodes(is_direct, {2});
  const auto judged = [](const LawCase& of) {
    return FilterRoute(of).step(of.steps[0]).packet_probability;
  };
  const std::vector<double> all = judged(law);
  CHECK(largest_difference(all, enumerate_sequences(law, 1).packet_probability) < 1e-10);
  // Negative control of the order of nodes: judged when its own packets alone are seen, a node's
  // posteriors would depend on its place.
  CHECK(largest_difference(those_of_node(all, law.steps[0], 0), judged_alone(law, 0)) > 0.01);
  LawCase other = law;
  other.steps[0].packets.back().y[0] += 1.0;
  REQUIRE(other.steps[0].packets.back().source == kNumNodes - 1);
  CHECK(largest_difference(those_of_node(all, law.steps[0], 0),
                           those_of_node(judged(other), law.steps[0], 0)) > 0.001);
}

TEST_CASE("merging between nodes leaves posteriors of packets that fit the unmerged ones") {
  const bool is_direct = GENERATE(true, false);
  const auto merge_below = GENERATE(0.0, 0.1);
  const LawCase law = three_nodes(is_direct, {3, 2, 3});
  FilterRoute filter(law, [&](HybridBernoulliOptions& options) {
    options.prune_below = 1e-4;
    options.merge_below = merge_below;
    options.components_max = 5;
  });
  for (std::size_t k = 0; k < law.steps.size(); ++k) {
    const LawPosterior reduced = filter.step(law.steps[k]);
    CHECK(largest_sum_of_node(reduced.packet_probability, law.steps[k]) <= 1.0 + 1e-9);
    if (k > 0) continue;
    const LawPosterior exact = enumerate_sequences(law, 1);
    const double off = largest_difference(reduced.packet_probability, exact.packet_probability);
    CHECK(off < 0.01);
    CHECK(off > 1e-9);  // something was reduced before the last node
    const std::vector<double> alone = judged_alone(law, 0);
    CHECK(largest_difference(alone, those_of_node(exact.packet_probability, law.steps[0], 0)) >
          0.03);
  }
}

TEST_CASE("packets that pruning drops, or the cap, keep the posterior that they had") {
  const bool is_direct = GENERATE(true, false);
  const bool prunes = GENERATE(true, false);
  LawCase law = three_nodes(is_direct, {1});
  // Forty times the same one, first of all: each is too little to be kept.
  law.steps[0].packets.insert(law.steps[0].packets.begin(), 39, law.steps[0].packets[0]);
  FilterRoute filter(law, [&](HybridBernoulliOptions& options) {
    if (prunes) options.prune_below = 0.04;
    if (!prunes) options.components_max = 3;
  });
  const std::vector<double> got = filter.step(law.steps[0]).packet_probability;
  const std::vector<double> exact = enumerate_sequences(law, 1).packet_probability;
  CHECK(filter.filter().num_candidates() < 2 * (41 + 41 * 2));  // not all reach the second node
  CHECK(largest_difference(got, exact) < 0.01);
  for (std::size_t p = 0; p < 40; ++p) CHECK(got[p] == Approx(exact[p]).epsilon(0.05));
}

TEST_CASE("a node that nothing explains, or whose packets are refused, leaves the others' alone") {
  const bool is_first = GENERATE(true, false);
  LawCase law = three_nodes(true, {2});
  law.pd = 1.0;
  law.model.C.row(0).setZero();
  law.model.H.row(0).setZero();
  law.model.R(0, 0) = 1e-120;
  const LawCase turned =
      in_order(law, is_first ? std::vector<int>{0, 1, 2} : std::vector<int>{1, 2, 0});
  const int node = is_first ? 0 : 2;
  const auto step_with = [&](double value) {
    LawStep step = turned.steps[0];
    for (LawPacket& packet : step.packets) {
      if (packet.source == node) packet.y[0] = value;
    }
    return step;
  };
  LawStep without = turned.steps[0];
  const auto is_of_node = [&](const LawPacket& packet) { return packet.source == node; };
  without.packets.erase(std::remove_if(without.packets.begin(), without.packets.end(), is_of_node),
                        without.packets.end());
  const std::vector<double> expected = FilterRoute(turned).step(without).packet_probability;
  for (const double value : {1e99, std::numeric_limits<double>::quiet_NaN()}) {
    FilterRoute filter(turned);
    const LawStep step = step_with(value);
    const std::vector<double> all = filter.step(step).packet_probability;
    CHECK(filter.estimate().outcome ==
          (std::isnan(value) ? StepOutcome::kRefusedInput : StepOutcome::kDegenerateWeights));
    const std::vector<double> spoiled = those_of_node(all, step, node);
    CHECK(std::all_of(spoiled.begin(), spoiled.end(), [](double p) { return p == 0.0; }));
    std::vector<double> rest;
    for (std::size_t p = 0; p < all.size(); ++p) {
      if (step.packets[p].source != node) rest.push_back(all[p]);
    }
    CHECK(largest_difference(rest, expected) < 1e-12);
  }
}

TEST_CASE("packets so far away that rounding makes their weights one are shared in equal parts") {
  const auto order = GENERATE(std::vector<int>{0, 1, 2}, std::vector<int>{1, 2, 0});
  LawCase law = three_nodes(true, {2});
  law.pd = 1.0;
  law.start_probability = 0.0;
  law.model.C.row(0).setZero();
  law.model.R(0, 0) = 1e-120;
  for (LawPacket& packet : law.steps[0].packets) {
    if (packet.source == 0) packet.y[0] = 1e90;
  }
  const LawCase turned = in_order(law, order);
  const std::vector<double> all = FilterRoute(turned).step(turned.steps[0]).packet_probability;
  CHECK(largest_sum_of_node(all, turned.steps[0]) == Approx(1.0));
  for (const double probability : those_of_node(all, law.steps[0], 0)) {
    CHECK(probability == Approx(0.5));
  }
}

TEST_CASE("a hypothesis that a node rules out has no say in the packets of the others") {
  const auto order = GENERATE(std::vector<int>{1, 0, 2}, std::vector<int>{0, 2, 1});
  LawCase law = three_nodes(true, {2});
  law.pd = 1.0;
  law.model.C.row(1).setZero();
  law.model.H.row(0).setZero();
  law.model.H.row(2).setZero();
  law.model.R(1, 1) = 1e-305;  // so that the square of 1e3 is infinite
  for (LawPacket& packet : law.steps[0].packets) {
    if (packet.source == 1) packet.y[0] = 1e3;  // only an attack sends that
  }
  law = in_order(law, order);
  FilterRoute filter(law);
  const std::vector<double> all = filter.step(law.steps[0]).packet_probability;
  CHECK(filter.filter().attack_probability() == 1.0);
  law.start_probability = 1.0;
  CHECK(largest_difference(all, FilterRoute(law).step(law.steps[0]).packet_probability) < 1e-8);
  CHECK(largest_sum_of_node(all, law.steps[0]) == Approx(1.0));
}
