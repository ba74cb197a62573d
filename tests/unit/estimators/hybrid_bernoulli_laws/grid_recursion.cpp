#include "tests/unit/estimators/hybrid_bernoulli_laws/grid_recursion.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <numbers>

namespace holdfast::testing {
namespace {

double normal_density(const Eigen::VectorXd& deviation, const Eigen::MatrixXd& covariance) {
  const double quadratic = deviation.dot(covariance.llt().solve(deviation));
  const double volume = std::sqrt((2.0 * std::numbers::pi * covariance).determinant());
  return std::exp(-0.5 * quadratic) / volume;
}

double normal_density(double deviation, double variance) {
  return std::exp(-0.5 * deviation * deviation / variance) /
         std::sqrt(2.0 * std::numbers::pi * variance);
}

// Nodes and weights of Gauss-Legendre on [0, 1] for eight points, by Newton's method.
std::vector<std::pair<double, double>> legendre_nodes() {
  constexpr int kSize = 8;
  std::vector<std::pair<double, double>> nodes;
  for (int i = 0; i < kSize; ++i) {
    double t = std::cos(std::numbers::pi * (i + 0.75) / (kSize + 0.5)), slope = 0.0;
    for (int iteration = 0; iteration < 20; ++iteration) {
      const double value = std::legendre(kSize, t);
      slope = kSize * (t * value - std::legendre(kSize - 1, t)) / (t * t - 1.0);
      t -= value / slope;
    }
    nodes.emplace_back(0.5 * (1.0 + t), 1.0 / ((1.0 - t * t) * slope * slope));
  }
  return nodes;
}

}  // namespace

// One association, ready to be evaluated at many points.
struct GridRecursion::Explanation {
  std::vector<int> authentic;
  double factor = 1.0;
  int num_delivered = 0, num_lost = 0;
  Eigen::VectorXd y;
  Eigen::MatrixXd C, H, precision;
  double scale = 1.0;

  double likelihood(double x, const Eigen::VectorXd& a, double pd) const {
    double value = factor * std::pow(pd, num_delivered) * std::pow(1.0 - pd, num_lost);
    if (y.size() == 0) return value;
    Eigen::Vector3d residual = Eigen::Vector3d::Zero();  // at most three rows
    for (Eigen::Index i = 0; i < y.size(); ++i) {
      residual[i] = y[i] - C(i, 0) * x;
      for (Eigen::Index j = 0; j < a.size(); ++j) residual[i] -= H(i, j) * a[j];
    }
    double quadratic = 0.0;
    for (Eigen::Index i = 0; i < y.size(); ++i) {
      for (Eigen::Index j = 0; j < y.size(); ++j) {
        quadratic += residual[i] * precision(i, j) * residual[j];
      }
    }
    return value * scale * std::exp(-0.5 * quadratic);
  }
};

GridRecursion::GridRecursion(const LawCase& law, const GridAxis& x, const GridAxis& a)
    : law_(law), x_(x), a_(a), transfer0_(x.size, x.size) {
  for (int to = 0; to < x_.size; ++to) {
    for (int from = 0; from < x_.size; ++from) {
      transfer0_(to, from) =
          x_.spacing *
          normal_density(x_.at(to) - law_.model.A(0, 0) * x_.at(from), law_.model.Q(0, 0));
    }
  }
  for (const AttackLaw& attack : law_.attacks) attacks_.push_back(make_attack_grid(attack));
  if (!law_.is_delivery_unknown()) {
    nodes_.push_back({law_.pd, 1.0, 0.0, 0.0, {}, {}, {}, {}});
  } else {
    for (const auto& [pd, weight] : legendre_nodes()) {
      const double beta =
          std::pow(pd, law_.delivered_count - 1.0) * std::pow(1.0 - pd, law_.lost_count - 1.0);
      nodes_.push_back({pd, weight * beta, 0.0, 0.0, {}, {}, {}, {}});
    }
  }
  for (Node& node : nodes_) start(node);
}

GridRecursion::AttackGrid GridRecursion::make_attack_grid(const AttackLaw& attack) const {
  AttackGrid grid;
  const auto num_channels = attack.channels.size();
  int size = 1;
  for (std::size_t c = 0; c < num_channels; ++c) {
    size *= a_.size;
    grid.cell *= a_.spacing;
  }
  grid.a = Eigen::MatrixXd::Zero(law_.m(), size);
  grid.density = Eigen::VectorXd::Zero(size);
  for (int point = 0; point < size; ++point) {
    Eigen::VectorXd a(static_cast<Eigen::Index>(num_channels));
    int rest = point;
    for (std::size_t c = 0; c < num_channels; ++c, rest /= a_.size) {
      a[static_cast<Eigen::Index>(c)] = a_.at(rest % a_.size);
      grid.a(attack.channels[c], point) = a_.at(rest % a_.size);
    }
    for (const SignalTerm& term : attack.terms) {
      grid.density[point] += term.weight * normal_density(a - term.mean, term.covariance);
    }
  }
  grid.transfer.resize(x_.size, x_.size * size);
  const Eigen::RowVectorXd push = law_.model.G.row(0) * grid.a;
  for (int point = 0; point < size; ++point) {
    for (int from = 0; from < x_.size; ++from) {
      const double center = law_.model.A(0, 0) * x_.at(from) + push[point];
      for (int to = 0; to < x_.size; ++to) {
        grid.transfer(to, from + x_.size * point) =
            x_.spacing * normal_density(x_.at(to) - center, law_.model.Q(0, 0));
      }
    }
  }
  return grid;
}

void GridRecursion::start(Node& node) const {
  node.r = law_.start_probability;
  node.p0.resize(x_.size);
  for (int i = 0; i < x_.size; ++i) {
    node.p0[i] = normal_density(x_.at(i) - law_.start_mean[0], law_.start_covariance(0, 0));
  }
  for (std::size_t v = 0; v < attacks_.size(); ++v) {
    node.p1.push_back(law_.attacks[v].probability * node.p0 * attacks_[v].density.transpose());
  }
}

void GridRecursion::predict(Node& node) const {
  const double r = node.r, next = (1.0 - r) * law_.pb + r * law_.ps;
  // Densities of x when an attack of each law has moved it, before noise when without feedthrough.
  Eigen::VectorXd from_calm = node.p0, from_all = Eigen::VectorXd::Zero(x_.size);
  std::vector<Eigen::VectorXd> from;
  if (law_.is_direct) from_calm = transfer0_ * node.p0;
  for (std::size_t v = 0; v < attacks_.size(); ++v) {
    const Eigen::Map<const Eigen::VectorXd> all(node.p1[v].data(), node.p1[v].size());
    Eigen::VectorXd moved = node.p1[v].rowwise().sum();
    if (law_.is_direct) moved = attacks_[v].transfer * all;
    from.push_back(attacks_[v].cell * moved);
    from_all += from.back();
  }
  for (std::size_t v = 0; v < attacks_.size(); ++v) {
    const double drawn = law_.attacks[v].probability;
    const Eigen::VectorXd attacked =
        (1.0 - r) * law_.pb * drawn * from_calm +
        r * law_.ps * ((1.0 - law_.persistence) * drawn * from_all + law_.persistence * from[v]);
    for (Eigen::Index point = 0; point < node.p1[v].cols(); ++point) {
      const double density = attacks_[v].density[point] / next;
      if (law_.is_direct) {
        node.p1[v].col(point) = density * attacked;
      } else {
        node.p1[v].col(point) =
            density * (attacks_[v].transfer.middleCols(point * x_.size, x_.size) * attacked);
      }
    }
  }
  node.p0 =
      ((1.0 - r) * (1.0 - law_.pb) * from_calm + r * (1.0 - law_.ps) * from_all) / (1.0 - next);
  if (!law_.is_direct) node.p0 = (transfer0_ * node.p0).eval();
  node.r = next;
}

std::vector<GridRecursion::Explanation> GridRecursion::explanations(const LawStep& step) const {
  std::vector<Explanation> all;
  for (const Association& association : associations(law_, step)) {
    Explanation explanation;
    explanation.authentic = association.authentic;
    explanation.factor = association.factor;
    explanation.num_delivered = association.num_delivered;
    explanation.num_lost = association.num_lost;
    std::vector<int> rows;
    std::vector<double> values;
    for (const int p : association.authentic) {
      const LawPacket& packet = step.packets[static_cast<std::size_t>(p)];
      const auto& of_source = law_.rows[static_cast<std::size_t>(packet.source)];
      rows.insert(rows.end(), of_source.begin(), of_source.end());
      values.insert(values.end(), packet.y.begin(), packet.y.end());
    }
    explanation.y =
        Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
    explanation.C = law_.model.C(rows, Eigen::all);
    explanation.H = law_.model.H(rows, Eigen::all);
    if (!law_.is_direct) explanation.H.setZero();
    if (!rows.empty()) {
      const Eigen::MatrixXd R = law_.model.R(rows, rows);
      explanation.precision = R.inverse();
      explanation.scale = 1.0 / std::sqrt((2.0 * std::numbers::pi * R).determinant());
    }
    all.push_back(explanation);
  }
  return all;
}

double GridRecursion::likelihood(const Node& node, const std::vector<Explanation>& all, double x,
                                 const Eigen::VectorXd& a) const {
  double sum = 0.0;
  for (const Explanation& explanation : all) sum += explanation.likelihood(x, a, node.pd);
  return sum;
}

// Of what the coming packets say of each [x; a] before the prediction.
void GridRecursion::look_back(Node& node, const std::vector<Explanation>& all) const {
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(law_.m());
  Eigen::VectorXd calm(x_.size), attacked = Eigen::VectorXd::Zero(x_.size);
  std::vector<Eigen::VectorXd> attacked_by(attacks_.size(), attacked);
  for (int i = 0; i < x_.size; ++i) {
    calm[i] = likelihood(node, all, x_.at(i), none);
    for (std::size_t v = 0; v < attacks_.size(); ++v) {
      for (Eigen::Index point = 0; point < attacks_[v].a.cols(); ++point) {
        attacked_by[v][i] += attacks_[v].cell * attacks_[v].density[point] *
                             likelihood(node, all, x_.at(i), attacks_[v].a.col(point));
      }
      attacked[i] += law_.attacks[v].probability * attacked_by[v][i];
    }
  }
  const Eigen::VectorXd of_calm = law_.pb * attacked + (1.0 - law_.pb) * calm;
  double total = (1.0 - node.r) * x_.spacing * node.p0.dot(transfer0_.transpose() * of_calm);
  node.before = Eigen::MatrixXd::Zero(1 + law_.m(), 1 + law_.m());
  Eigen::VectorXd one_and_a(1 + law_.m());
  for (std::size_t v = 0; v < attacks_.size(); ++v) {
    const double keeps = law_.persistence;
    const Eigen::VectorXd said =
        attacks_[v].transfer.transpose() *
        (law_.ps * ((1.0 - keeps) * attacked + keeps * attacked_by[v]) + (1.0 - law_.ps) * calm);
    for (Eigen::Index point = 0; point < attacks_[v].a.cols(); ++point) {
      one_and_a << 1.0, attacks_[v].a.col(point);
      const double mass = node.r * x_.spacing * attacks_[v].cell *
                          node.p1[v].col(point).dot(said.segment(point * x_.size, x_.size));
      node.before += mass * one_and_a * one_and_a.transpose();
      total += mass;
    }
  }
  node.before /= total;
}

// Before the packets have their say: each explanation's part of the evidence.
void GridRecursion::judge(Node& node, const std::vector<Explanation>& all,
                          std::size_t num_packets) const {
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(law_.m());
  node.packet_probability.assign(num_packets, 0.0);
  double total = 0.0;
  for (const Explanation& explanation : all) {
    double evidence = 0.0;
    for (int i = 0; i < x_.size; ++i) {
      const double x = x_.at(i);
      evidence += (1.0 - node.r) * node.p0[i] * explanation.likelihood(x, none, node.pd);
      for (std::size_t v = 0; v < attacks_.size(); ++v) {
        const double mass = node.r * attacks_[v].cell;
        for (Eigen::Index point = 0; point < node.p1[v].cols(); ++point) {
          evidence += mass * node.p1[v](i, point) *
                      explanation.likelihood(x, attacks_[v].a.col(point), node.pd);
        }
      }
    }
    total += evidence;
    for (const int p : explanation.authentic) {
      node.packet_probability[static_cast<std::size_t>(p)] += evidence;
    }
  }
  for (double& probability : node.packet_probability) probability /= total;
}

void GridRecursion::correct(Node& node, const std::vector<Explanation>& all) const {
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(law_.m());
  for (int i = 0; i < x_.size; ++i) node.p0[i] *= likelihood(node, all, x_.at(i), none);
  const double evidence0 = x_.spacing * node.p0.sum();
  double evidence1 = 0.0;
  for (std::size_t v = 0; v < attacks_.size(); ++v) {
    for (Eigen::Index point = 0; point < node.p1[v].cols(); ++point) {
      const Eigen::VectorXd a = attacks_[v].a.col(point);
      for (int i = 0; i < x_.size; ++i) node.p1[v](i, point) *= likelihood(node, all, x_.at(i), a);
    }
    evidence1 += x_.spacing * attacks_[v].cell * node.p1[v].sum();
  }
  const double evidence = (1.0 - node.r) * evidence0 + node.r * evidence1;
  node.p0 /= evidence0;
  for (auto& density : node.p1) density /= evidence1;
  node.r *= evidence1 / evidence;
  node.log_evidence += std::log(evidence);
}

void GridRecursion::add_moments(const Node& node, double weight, LawPosterior& sum) const {
  sum.r += weight * node.r;
  sum.delivery_probability += weight * node.pd;
  for (int i = 0; i < x_.size; ++i) {
    const double mass = weight * (1.0 - node.r) * x_.spacing * node.p0[i];
    sum.mean0[0] += mass * x_.at(i);
    sum.square0(0, 0) += mass * x_.at(i) * x_.at(i);
  }
  for (std::size_t v = 0; v < attacks_.size(); ++v) {
    const AttackGrid& grid = attacks_[v];
    Eigen::VectorXd z(1 + law_.m());
    for (Eigen::Index point = 0; point < grid.a.cols(); ++point) {
      z.tail(law_.m()) = grid.a.col(point);
      for (int i = 0; i < x_.size; ++i) {
        z[0] = x_.at(i);
        const double mass = weight * node.r * x_.spacing * grid.cell * node.p1[v](i, point);
        sum.mean1 += mass * z;
        sum.square1 += mass * z * z.transpose();
        sum.attack_probability[v] += mass;
      }
    }
  }
}

LawPosterior GridRecursion::posterior() const {
  LawPosterior sum;
  const int size = 1 + law_.m();
  sum.mean0 = Eigen::VectorXd::Zero(1);
  sum.square0 = Eigen::MatrixXd::Zero(1, 1);
  sum.mean1 = Eigen::VectorXd::Zero(size);
  sum.square1 = Eigen::MatrixXd::Zero(size, size);
  sum.attack_probability.assign(attacks_.size(), 0.0);
  sum.packet_probability.assign(nodes_[0].packet_probability.size(), 0.0);
  double total = 0.0;
  for (const Node& node : nodes_) total += node.weight * std::exp(node.log_evidence);
  for (const Node& node : nodes_) {
    const double weight = node.weight * std::exp(node.log_evidence) / total;
    add_moments(node, weight, sum);
    for (std::size_t p = 0; p < sum.packet_probability.size(); ++p) {
      sum.packet_probability[p] += weight * node.packet_probability[p];
    }
  }
  if (nodes_[0].before.size() > 0) {
    Eigen::MatrixXd before = 0.0 * nodes_[0].before;
    for (const Node& node : nodes_) {
      before += node.weight * std::exp(node.log_evidence) / total * node.before;
    }
    sum.r_before = before(0, 0);
    sum.mean_before = before.col(0).tail(law_.m()) / sum.r_before;
    sum.square_before = before.bottomRightCorner(law_.m(), law_.m()) / sum.r_before;
  }
  sum.mean0 /= 1.0 - sum.r;
  sum.square0 /= 1.0 - sum.r;
  sum.mean1 /= sum.r;
  sum.square1 /= sum.r;
  for (double& probability : sum.attack_probability) probability /= sum.r;
  return sum;
}

LawPosterior GridRecursion::step(const LawStep& step) {
  const std::vector<Explanation> all = explanations(step);
  for (Node& node : nodes_) {
    if (!is_first_ && law_.is_direct) look_back(node, all);
    if (!is_first_) predict(node);
    judge(node, all, step.packets.size());
    correct(node, all);
  }
  is_first_ = false;
  return posterior();
}

}  // namespace holdfast::testing
