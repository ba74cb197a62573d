#include "tests/unit/estimators/hybrid_bernoulli_laws/law_cases.h"

#include <numeric>

#include "common/random_stream.h"

namespace holdfast::testing {
namespace {

SignalTerm scalar_term(double weight, double mean, double variance) {
  return {weight, Eigen::VectorXd::Constant(1, mean), Eigen::MatrixXd::Constant(1, 1, variance)};
}

void set_box(LawCase& law, double half) {
  law.box_low = Eigen::VectorXd::Constant(law.model.num_measurements(), -half);
  law.box_high = -law.box_low;
}

void name_parts(SystemModel& model) {
  for (int i = 0; i < model.num_states(); ++i) model.state_names.push_back("x" + std::to_string(i));
  for (int i = 0; i < model.num_measurements(); ++i) {
    model.measurement_names.push_back("y" + std::to_string(i));
  }
  for (int i = 0; i < model.num_attack_channels(); ++i) {
    model.attack_names.push_back("a" + std::to_string(i));
  }
}

// Gaussian numbers in the order of the calls.
class Draws {
 public:
  explicit Draws(std::uint32_t number) : stream_(4, number, "test/random_case") {}
  Eigen::MatrixXd matrix(int rows, int columns) {
    Eigen::MatrixXd result(rows, columns);
    for (double& value : result.reshaped()) value = stream_.normal(0, next_++);
    return result;
  }
  Eigen::MatrixXd covariance(int size) {
    const Eigen::MatrixXd root = matrix(size, size);
    return 0.3 * root * root.transpose() / size + 0.2 * Eigen::MatrixXd::Identity(size, size);
  }

 private:
  RandomStream stream_;
  std::uint64_t next_ = 0;
};

}  // namespace

LawCase scalar_case(bool is_direct, CorrectionLaw correction) {
  LawCase law;
  law.is_direct = is_direct;
  law.model.A = Eigen::MatrixXd::Constant(1, 1, 0.8);
  law.model.G = Eigen::MatrixXd::Constant(1, 1, 0.7);
  law.model.C = (Eigen::MatrixXd(2, 1) << 1.0, -0.6).finished();
  law.model.H = (Eigen::MatrixXd(2, 1) << 0.5, 0.9).finished();
  law.model.Q = Eigen::MatrixXd::Constant(1, 1, 0.3);
  law.model.R = (Eigen::MatrixXd(2, 2) << 0.4, 0.1, 0.1, 0.5).finished();
  if (!is_direct) law.model.H.setZero();
  name_parts(law.model);
  law.start_mean = Eigen::VectorXd::Constant(1, 0.4);
  law.start_covariance = Eigen::MatrixXd::Constant(1, 1, 0.9);
  law.attacks = {{1.0, {0}, {scalar_term(0.6, 1.2, 0.7), scalar_term(0.4, -0.5, 0.9)}}};
  law.rows = {{0, 1}};
  set_box(law, 8.0);
  const auto packet = [](double y1, double y2) {
    return LawPacket{(Eigen::VectorXd(2) << y1, y2).finished(), 0};
  };
  law.steps = {{correction, {packet(1.3, 0.6), packet(-0.4, 1.0)}},
               {correction, {}},
               {correction, {packet(2.1, 0.2)}},
               {correction, {packet(0.9, -0.7), packet(1.6, 1.1)}}};
  if (correction == kSubstitution) {
    law.steps[0].packets.pop_back();
    law.steps[3].packets.pop_back();
  }
  return law;
}

LawCase two_attacks_case(bool is_direct, CorrectionLaw correction, double persistence) {
  LawCase law = scalar_case(is_direct, correction);
  law.model.G = (Eigen::MatrixXd(1, 2) << 0.7, -0.8).finished();
  if (is_direct) {
    law.model.H = (Eigen::MatrixXd(2, 2) << 0.5, 0.3, 0.9, -0.6).finished();
  } else {
    law.model.H = Eigen::MatrixXd::Zero(2, 2);
  }
  law.model.attack_names = {"a0", "a1"};
  law.persistence = persistence;
  law.attacks = {{0.65, {0}, {scalar_term(1.0, 1.2, 0.7)}},
                 {0.35, {1}, {scalar_term(1.0, -0.5, 0.9)}}};
  return law;
}

LawCase unknown_delivery_case(bool is_direct, CorrectionLaw correction) {
  LawCase law = scalar_case(is_direct, correction);
  law.delivered_count = 4.0;
  law.lost_count = 2.0;
  return law;
}

LawCase partial_packets_case(bool is_direct) {
  LawCase law = scalar_case(is_direct, kInjection);
  law.attacks[0].terms = {scalar_term(1.0, 1.2, 0.7)};
  law.rows = {{0}, {1}};
  law.model.R = Eigen::Vector2d(0.4, 0.5).asDiagonal();
  const auto packet = [](double value, int source) {
    return LawPacket{Eigen::VectorXd::Constant(1, value), source};
  };
  law.steps = {{kInjection, {packet(1.3, 0), packet(0.6, 1), packet(-0.4, 0)}},
               {kInjection, {}},
               {kInjection, {packet(2.1, 0)}},
               {kInjection, {packet(-0.7, 1), packet(1.1, 1), packet(0.9, 0)}}};
  return law;
}

LawCase overlapping_sources_case(bool is_direct) {
  LawCase law = scalar_case(is_direct, kInjection);
  law.attacks[0].terms = {scalar_term(1.0, 1.2, 0.7)};
  law.rows = {{0, 1}, {1}};
  law.steps[0].packets.push_back({Eigen::VectorXd::Constant(1, 0.5), 1});
  law.steps[1].packets.push_back({Eigen::VectorXd::Constant(1, -0.2), 1});
  return law;
}

LawCase rank_deficient_case() {
  LawCase law = scalar_case(true, kInjection);
  law.model.G = (Eigen::MatrixXd(1, 2) << 0.7, 0.6).finished();
  law.model.H = (Eigen::MatrixXd(2, 2) << 0.5, 0.0, 0.9, 0.0).finished();
  make_rank_deficient(law);
  law.model.attack_names = {"a0", "a1"};
  law.attacks = {
      {1.0,
       {0, 1},
       {{1.0, Eigen::Vector2d(1.2, -0.5), (Eigen::Matrix2d() << 0.7, 0.2, 0.2, 0.9).finished()}}}};
  law.steps.resize(3);
  return law;
}

LawCase random_case(std::uint32_t number, int n, int m, int l, bool is_direct,
                    CorrectionLaw correction, const std::vector<int>& num_packets) {
  Draws draws(number);
  LawCase law;
  law.is_direct = is_direct;
  law.model.A = draws.matrix(n, n);
  law.model.A *= 0.9 / law.model.A.norm();
  law.model.G = draws.matrix(n, m);
  law.model.C = draws.matrix(l, n);
  law.model.H = is_direct ? draws.matrix(l, m) : Eigen::MatrixXd::Zero(l, m);
  law.model.Q = draws.covariance(n);
  law.model.R = draws.covariance(l);
  name_parts(law.model);
  law.start_mean = draws.matrix(n, 1);
  law.start_covariance = draws.covariance(n);
  AttackLaw attack{1.0, std::vector<int>(static_cast<std::size_t>(m)), {}};
  std::iota(attack.channels.begin(), attack.channels.end(), 0);
  const bool has_two_terms = number % 2 == 1;
  attack.terms.push_back({has_two_terms ? 0.7 : 1.0, draws.matrix(m, 1), draws.covariance(m)});
  if (has_two_terms) attack.terms.push_back({0.3, draws.matrix(m, 1), draws.covariance(m)});
  law.attacks = {attack};
  law.rows = {std::vector<int>(static_cast<std::size_t>(l))};
  std::iota(law.rows[0].begin(), law.rows[0].end(), 0);
  set_box(law, 8.0);
  Eigen::VectorXd x = law.start_mean;
  for (const int count : num_packets) {
    LawStep step{correction, {}};
    for (int p = 0; p < count; ++p) {
      step.packets.push_back({law.model.C * x + 0.7 * draws.matrix(l, 1), 0});
    }
    law.steps.push_back(step);
    x = law.model.A * x + 0.7 * draws.matrix(n, 1);
  }
  return law;
}

void make_rank_deficient(LawCase& law) {
  law.model.H.col(1) = 0.5 * law.model.H.col(0);
}

LawCase everything_case(bool is_direct) {
  LawCase law = random_case(8, 2, 2, 3, is_direct, kInjection, {2, 1, 1});
  make_rank_deficient(law);
  law.model.R.row(2) << 0.0, 0.0, law.model.R(2, 2);
  law.model.R.col(2).head(2).setZero();
  law.attacks = {{0.6, {0}, {scalar_term(1.0, 0.8, 0.7)}},
                 {0.4, {1}, {scalar_term(1.0, -0.6, 1.1)}}};
  law.persistence = 0.5;
  law.delivered_count = 3.0;
  law.lost_count = 1.5;
  law.rows = {{0, 1}, {2}};
  for (LawStep& step : law.steps) {
    const std::vector<LawPacket> whole = step.packets;
    step.packets.clear();
    for (const LawPacket& packet : whole) {
      step.packets.push_back({packet.y.tail(1), 1});
      step.packets.push_back({packet.y.head(2), 0});
    }
  }
  law.steps[1].packets.pop_back();  // the first node's only one
  return law;
}

}  // namespace holdfast::testing
