#include "tests/unit/estimators/hybrid_bernoulli_laws/law_case.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace holdfast::testing {

namespace {

const std::vector<int>& rows_of(const LawCase& law, const LawPacket& packet) {
  return law.rows[static_cast<std::size_t>(packet.source)];
}

// Of each source, the first source that shares rows with it, directly or in a chain.
std::vector<std::size_t> nodes(const LawCase& law) {
  std::vector<std::size_t> node(law.rows.size());
  std::iota(node.begin(), node.end(), std::size_t{0});
  const auto overlap = [&](std::size_t s, std::size_t t) {
    const auto& rows = law.rows[s];
    return std::any_of(rows.begin(), rows.end(), [&](int row) {
      return std::count(law.rows[t].begin(), law.rows[t].end(), row) > 0;
    });
  };
  for (std::size_t round = 0; round < node.size(); ++round) {
    for (std::size_t s = 0; s < node.size(); ++s) {
      for (std::size_t t = 0; t < node.size(); ++t) {
        if (overlap(s, t)) node[s] = node[t] = std::min(node[s], node[t]);
      }
    }
  }
  return node;
}

// Those among them that are out of the box, when that makes them certain.
std::vector<int> certain(const LawCase& law, const LawStep& step, const std::vector<int>& packets) {
  std::vector<int> result;
  if (law.outside != OutsideLaw::kZero) return result;
  for (const int p : packets) {
    if (is_outside(law, step.packets[static_cast<std::size_t>(p)])) result.push_back(p);
  }
  return result;
}

std::vector<Association> substitution_associations(const LawCase& law, const LawStep& step) {
  if (step.packets.empty()) return {{{}, 1.0, 0, law.is_delivery_unknown() ? 1 : 0}};
  if (!certain(law, step, {0}).empty()) return {{{0}, 1.0, 1, 0}};
  return {{{}, law.pf * fake_density(law, step.packets[0]), 1, 0}, {{0}, 1.0 - law.pf, 1, 0}};
}

}  // namespace

bool is_outside(const LawCase& law, const LawPacket& packet) {
  const auto& rows = rows_of(law, packet);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const double value = packet.y[static_cast<Eigen::Index>(i)];
    if (value < law.box_low[rows[i]] || value > law.box_high[rows[i]]) return true;
  }
  return false;
}

double fake_density(const LawCase& law, const LawPacket& packet) {
  double density = 1.0;
  for (const int row : rows_of(law, packet)) density /= law.box_high[row] - law.box_low[row];
  return law.outside == OutsideLaw::kFloor && is_outside(law, packet) ? density * law.floor
                                                                      : density;
}

std::vector<Association> associations(const LawCase& law, const LawStep& step) {
  if (step.correction == kSubstitution) return substitution_associations(law, step);
  std::vector<Association> all = {{}};
  const std::vector<std::size_t> node_of_source = nodes(law);
  for (std::size_t node = 0; node < law.rows.size(); ++node) {
    if (node_of_source[node] != node) continue;
    std::vector<int> of_node;
    for (std::size_t p = 0; p < step.packets.size(); ++p) {
      const auto source = static_cast<std::size_t>(step.packets[p].source);
      if (node_of_source[source] == node) of_node.push_back(static_cast<int>(p));
    }
    // Nothing of a node says something of an unknown pd, and nothing of anything else.
    if (of_node.empty() && !law.is_delivery_unknown()) continue;
    const std::vector<int> sure = certain(law, step, of_node);
    std::vector<Association> longer;
    for (const Association& before : all) {
      Association lost = before;
      ++lost.num_lost;
      if (sure.empty()) longer.push_back(lost);
      for (const int p : sure.empty() ? of_node : sure) {
        Association taken = before;
        ++taken.num_delivered;
        taken.authentic.push_back(p);
        taken.factor /= static_cast<double>(of_node.size());
        if (sure.empty()) {
          taken.factor /= fake_density(law, step.packets[static_cast<std::size_t>(p)]);
        }
        longer.push_back(taken);
      }
    }
    all = longer;
  }
  return all;
}

double worse(double a, double b) {
  return std::isnan(a) || a >= b ? a : b;
}

double difference(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  if (a.rows() != b.rows() || a.cols() != b.cols()) return std::numeric_limits<double>::infinity();
  if (a.size() == 0) return 0.0;
  const double scale = std::max({1.0, a.cwiseAbs().maxCoeff(), b.cwiseAbs().maxCoeff()});
  // The sum is NaN when any number is; a maximum may not be.
  return (a - b).cwiseAbs().maxCoeff() / scale + 0.0 * (a - b).sum();
}

double disagreement(const LawPosterior& a, const LawPosterior& b) {
  double worst = std::abs(a.r - b.r);
  const auto compare = [&worst](const Eigen::MatrixXd& p, const Eigen::MatrixXd& q) {
    worst = worse(worst, difference(p, q));
  };
  const auto compare_lists = [&](const std::vector<double>& p, const std::vector<double>& q) {
    if (p.empty() || q.empty()) return;
    compare(Eigen::Map<const Eigen::VectorXd>(p.data(), static_cast<Eigen::Index>(p.size())),
            Eigen::Map<const Eigen::VectorXd>(q.data(), static_cast<Eigen::Index>(q.size())));
  };
  if (a.r < 1.0 && b.r < 1.0) {
    compare(a.mean0, b.mean0);
    compare(a.covariance0(), b.covariance0());
  }
  if (a.r > 0.0 && b.r > 0.0) {
    compare(a.mean1, b.mean1);
    compare(a.covariance1(), b.covariance1());
  }
  if (a.mean_before.size() > 0 && b.mean_before.size() > 0) {
    compare_lists({a.r_before}, {b.r_before});
    compare(a.mean_before, b.mean_before);
    compare(a.square_before, b.square_before);
  }
  if (a.r > 0.0 && b.r > 0.0) compare_lists(a.attack_probability, b.attack_probability);
  compare_lists(a.packet_probability, b.packet_probability);
  compare_lists({a.delivery_probability}, {b.delivery_probability});
  return worst;
}

}  // namespace holdfast::testing
