#include "tests/unit/estimators/hybrid_bernoulli_laws/closed_forms.h"

#include <Eigen/LU>

namespace holdfast::testing {
namespace {

// A raw mean and second moment times a probability; a part of a mixture.
struct Part {
  double weight = 0.0;
  Eigen::VectorXd mean;
  Eigen::MatrixXd square;

  void add(const Part& other, double factor) {
    if (mean.size() == 0) *this = {0.0, 0.0 * other.mean, 0.0 * other.square};
    weight += factor;
    mean += factor * other.mean;
    square += factor * other.square;
  }
};

Part moved(const Eigen::MatrixXd& F, const Eigen::MatrixXd& Q, const Eigen::VectorXd& mean,
           const Eigen::MatrixXd& square) {
  return {1.0, F * mean, F * square * F.transpose() + Q};
}

// The attack signal over all channels.
Part attack_moments(const LawCase& law) {
  Part all{0.0, Eigen::VectorXd::Zero(law.m()), Eigen::MatrixXd::Zero(law.m(), law.m())};
  for (const AttackLaw& attack : law.attacks) {
    for (const SignalTerm& term : attack.terms) {
      Part part{1.0, Eigen::VectorXd::Zero(law.m()), Eigen::MatrixXd::Zero(law.m(), law.m())};
      part.mean(attack.channels) = term.mean;
      part.square(attack.channels, attack.channels) =
          term.covariance + term.mean * term.mean.transpose();
      all.add(part, attack.probability * term.weight);
    }
  }
  return all;
}

}  // namespace

LawPosterior predicted(const LawCase& law, const LawPosterior& now) {
  const Eigen::Index n = law.n(), m = law.m();
  const Eigen::MatrixXd &A = law.model.A, &G = law.model.G, &Q = law.model.Q;
  Eigen::MatrixXd F(n, n + m);
  F << A, (law.is_direct ? 1.0 : 0.0) * G;
  const Part from_calm = moved(A, Q, now.mean0, now.square0);
  const Part from_attack = moved(F, Q, now.mean1, now.square1);
  Part calm, attacked;
  calm.add(from_calm, (1.0 - now.r) * (1.0 - law.pb));
  calm.add(from_attack, now.r * (1.0 - law.ps));
  attacked.add(from_calm, (1.0 - now.r) * law.pb);
  attacked.add(from_attack, now.r * law.ps);

  const Part a = attack_moments(law);
  LawPosterior next = now;
  next.r = attacked.weight;
  next.mean0 = calm.mean / calm.weight;
  next.square0 = calm.square / calm.weight;
  const Eigen::VectorXd x = attacked.mean / attacked.weight;
  Eigen::MatrixXd T = Eigen::MatrixXd::Identity(n + m, n + m);
  if (!law.is_direct) T.topRightCorner(n, m) = G;
  Eigen::VectorXd mean(n + m);
  mean << x, a.mean;
  Eigen::MatrixXd square(n + m, n + m);
  square << attacked.square / attacked.weight, x * a.mean.transpose(), a.mean * x.transpose(),
      a.square;
  next.mean1 = T * mean;
  next.square1 = T * square * T.transpose();
  for (std::size_t v = 0; v < law.attacks.size(); ++v) {
    next.attack_probability[v] = law.attacks[v].probability;
  }
  next.packet_probability.clear();
  return next;
}

GaussianState kalman_step(const GaussianState& before, const Eigen::MatrixXd& F,
                          const Eigen::VectorXd& push, const Eigen::MatrixXd& process_noise,
                          const Eigen::MatrixXd& J, const Eigen::MatrixXd& noise,
                          const Eigen::VectorXd& y) {
  const Eigen::VectorXd mean = F * before.mean + push;
  const Eigen::MatrixXd covariance = F * before.covariance * F.transpose() + process_noise;
  const Eigen::MatrixXd information = covariance.inverse();
  const Eigen::MatrixXd weight = J.transpose() * noise.inverse();
  GaussianState after;
  after.covariance = (information + weight * J).inverse();
  after.mean = after.covariance * (information * mean + weight * y);
  return after;
}

GaussianState least_squares(const LawCase& law) {
  const Eigen::Index n = law.n(), m = law.m(), K = static_cast<Eigen::Index>(law.steps.size());
  const Eigen::Index size = K * (n + m);  // x_1, a_1, x_2, a_2, ..
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(size, size);
  Eigen::VectorXd vector = Eigen::VectorXd::Zero(size);
  const auto add = [&](const Eigen::MatrixXd& rows, const Eigen::MatrixXd& noise,
                       const Eigen::VectorXd& value) {
    const Eigen::MatrixXd weight = rows.transpose() * noise.inverse();
    information += weight * rows;
    vector += weight * value;
  };
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(n, size);
  rows.leftCols(n).setIdentity();
  add(rows, law.start_covariance, law.start_mean);
  for (Eigen::Index k = 0; k < K; ++k) {
    rows = Eigen::MatrixXd::Zero(law.model.num_measurements(), size);
    rows.middleCols(k * (n + m), n) = law.model.C;
    rows.middleCols(k * (n + m) + n, m) = law.model.H;
    add(rows, law.model.R, law.steps[static_cast<std::size_t>(k)].packets[0].y);
    if (k + 1 == K) break;
    rows = Eigen::MatrixXd::Zero(n, size);
    rows.middleCols(k * (n + m), n) = -law.model.A;
    rows.middleCols(k * (n + m) + n, m) = -law.model.G;
    rows.middleCols((k + 1) * (n + m), n).setIdentity();
    add(rows, law.model.Q, Eigen::VectorXd::Zero(n));
  }
  const Eigen::MatrixXd covariance = information.inverse();
  return {(covariance * vector).tail(n + m), covariance.bottomRightCorner(n + m, n + m)};
}

}  // namespace holdfast::testing
