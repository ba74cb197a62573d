#include "tests/unit/estimators/hybrid_bernoulli_laws/sequence_enumeration.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace holdfast::testing {
namespace {

constexpr int kCalm = -1;

// What is assumed of one step.
struct StepHypothesis {
  int attack = kCalm;
  std::size_t term = 0;
  Association association;
};

// A sequence of hypotheses, weighed: log of its probability jointly with what was received, and
// the Gaussian of the last [x; a] and, from the second step on, of the a before.
struct Weighed {
  double log_weight = 0.0;
  int last_attack = kCalm, attack_before = kCalm;
  std::vector<int> last_authentic;
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
  double mean_delivery = 0.0;
};

class Enumeration {
 public:
  Enumeration(const LawCase& law, std::size_t num_steps)
      : law_(law), K_(static_cast<Eigen::Index>(num_steps)), sequence_(num_steps) {
    for (std::size_t k = 0; k < num_steps; ++k) {
      associations_.push_back(associations(law, law.steps[k]));
    }
    extend(0, 0.0);
  }

  const std::vector<Weighed>& all() const { return all_; }

 private:
  void extend(std::size_t k, double log_prior) {
    if (k == sequence_.size()) return all_.push_back(weigh(log_prior));
    double attacked = law_.start_probability;
    if (k > 0) attacked = sequence_[k - 1].attack == kCalm ? law_.pb : law_.ps;
    for (const Association& association : associations_[k]) {
      if (association.factor == 0.0) continue;
      const double log_factor = log_prior + std::log(association.factor);
      sequence_[k] = {kCalm, 0, association};
      if (attacked < 1.0) extend(k + 1, log_factor + std::log(1.0 - attacked));
      if (attacked == 0.0) continue;
      const int before = k > 0 ? sequence_[k - 1].attack : kCalm;
      for (std::size_t v = 0; v < law_.attacks.size(); ++v) {
        const double of_attack =
            attacked * (before == kCalm
                            ? law_.attacks[v].probability
                            : law_.attack_probability(v, static_cast<std::size_t>(before)));
        if (of_attack == 0.0) continue;
        for (std::size_t t = 0; t < law_.attacks[v].terms.size(); ++t) {
          sequence_[k] = {static_cast<int>(v), t, association};
          extend(k + 1, log_factor + std::log(of_attack * law_.attacks[v].terms[t].weight));
        }
      }
    }
  }

  // Base variables: x_1, then a_1 .. a_K, then w_1 .. w_{K-1}; a_k is the attack of step k's r.
  Eigen::Index place_of_a(Eigen::Index k) const { return law_.n() + k * law_.m(); }
  Eigen::Index place_of_w(Eigen::Index k) const { return place_of_a(K_) + k * law_.n(); }

  void base_moments(Eigen::VectorXd& mean, Eigen::MatrixXd& covariance) const {
    const Eigen::Index n = law_.n(), size = place_of_w(K_ - 1);
    mean = Eigen::VectorXd::Zero(size);
    covariance = Eigen::MatrixXd::Zero(size, size);
    mean.head(n) = law_.start_mean;
    covariance.topLeftCorner(n, n) = law_.start_covariance;
    for (Eigen::Index k = 0; k < K_; ++k) {
      const StepHypothesis& step = sequence_[static_cast<std::size_t>(k)];
      if (step.attack != kCalm) {
        const AttackLaw& attack = law_.attacks[static_cast<std::size_t>(step.attack)];
        const SignalTerm& term = attack.terms[step.term];
        for (std::size_t i = 0; i < attack.channels.size(); ++i) {
          const Eigen::Index row = place_of_a(k) + attack.channels[i];
          mean[row] = term.mean[static_cast<Eigen::Index>(i)];
          for (std::size_t j = 0; j < attack.channels.size(); ++j) {
            covariance(row, place_of_a(k) + attack.channels[j]) =
                term.covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
          }
        }
      }
      if (k + 1 < K_) covariance.block(place_of_w(k), place_of_w(k), n, n) = law_.model.Q;
    }
  }

  // Rows of the authentic values of all steps as linear functions of the base variables, their
  // noise, and the last [x; a] and the a before as such functions.
  void stack(Eigen::MatrixXd& Y, Eigen::MatrixXd& noise, Eigen::VectorXd& y,
             Eigen::MatrixXd& Z) const {
    const Eigen::Index n = law_.n(), m = law_.m(), size = place_of_w(K_ - 1);
    std::vector<Eigen::RowVectorXd> all_rows;
    std::vector<double> values;
    std::vector<std::pair<std::size_t, int>> origin;  // step and row of y
    Eigen::MatrixXd X = Eigen::MatrixXd::Zero(n, size), a(m, size);
    X.leftCols(n).setIdentity();
    for (Eigen::Index k = 0; k < K_; ++k) {
      a.setZero();
      a.middleCols(place_of_a(k), m).setIdentity();
      if (k > 0) {
        Eigen::MatrixXd before = Eigen::MatrixXd::Zero(m, size);
        before.middleCols(place_of_a(k - 1), m).setIdentity();
        X = (law_.model.A * X + law_.model.G * (law_.is_direct ? before : a)).eval();
        X.middleCols(place_of_w(k - 1), n) += Eigen::MatrixXd::Identity(n, n);
      }
      Eigen::MatrixXd measured = law_.model.C * X;
      if (law_.is_direct) measured += law_.model.H * a;
      const auto index = static_cast<std::size_t>(k);
      for (const int p : sequence_[index].association.authentic) {
        const LawPacket& packet = law_.steps[index].packets[static_cast<std::size_t>(p)];
        const auto& rows = law_.rows[static_cast<std::size_t>(packet.source)];
        for (std::size_t i = 0; i < rows.size(); ++i) {
          all_rows.emplace_back(measured.row(rows[i]));
          values.push_back(packet.y[static_cast<Eigen::Index>(i)]);
          origin.emplace_back(index, rows[i]);
        }
      }
    }
    const auto num_rows = static_cast<Eigen::Index>(values.size());
    Y.resize(num_rows, size);
    noise = Eigen::MatrixXd::Zero(num_rows, num_rows);
    y = Eigen::Map<const Eigen::VectorXd>(values.data(), num_rows);
    for (Eigen::Index i = 0; i < num_rows; ++i) {
      const auto& [step_i, row_i] = origin[static_cast<std::size_t>(i)];
      Y.row(i) = all_rows[static_cast<std::size_t>(i)];
      for (Eigen::Index j = 0; j < num_rows; ++j) {
        const auto& [step_j, row_j] = origin[static_cast<std::size_t>(j)];
        if (step_i == step_j) noise(i, j) = law_.model.R(row_i, row_j);
      }
    }
    Z = Eigen::MatrixXd::Zero(n + (K_ > 1 ? 2 : 1) * m, size);
    Z.topRows(n) = X;
    Z.middleRows(n, m) = a;
    if (K_ > 1) Z.block(n + m, place_of_a(K_ - 2), m, m).setIdentity();
  }

  Weighed weigh(double log_prior) const {
    Eigen::VectorXd mean, y;
    Eigen::MatrixXd covariance, Y, noise, Z;
    base_moments(mean, covariance);
    stack(Y, noise, y, Z);
    Weighed result;
    result.log_weight = log_prior + log_delivery(result.mean_delivery);
    result.last_attack = sequence_.back().attack;
    if (K_ > 1) result.attack_before = sequence_[sequence_.size() - 2].attack;
    result.last_authentic = sequence_.back().association.authentic;
    result.mean = Z * mean;
    result.covariance = Z * covariance * Z.transpose();
    if (y.size() == 0) return result;
    const Eigen::LLT<Eigen::MatrixXd> llt(Y * covariance * Y.transpose() + noise);
    const Eigen::MatrixXd cross = Y * covariance * Z.transpose();
    const Eigen::MatrixXd white_cross = llt.matrixL().solve(cross);
    const Eigen::VectorXd white = llt.matrixL().solve(y - Y * mean);
    result.mean += white_cross.transpose() * white;
    result.covariance -= white_cross.transpose() * white_cross;
    result.log_weight -= 0.5 * white.squaredNorm() +
                         llt.matrixLLT().diagonal().array().log().sum() +
                         0.5 * static_cast<double>(y.size()) * std::log(2.0 * std::numbers::pi);
    return result;
  }

  // Of this many deliveries and losses; for a beta prior with it integrated out.
  double log_delivery(double& mean) const {
    int delivered = 0, lost = 0;
    for (const StepHypothesis& step : sequence_) {
      delivered += step.association.num_delivered;
      lost += step.association.num_lost;
    }
    if (!law_.is_delivery_unknown()) {
      mean = law_.pd;
      // A loss that pd = 1 rules out has log 0; 0 log 0 = 0.
      const double of_lost = lost == 0 ? 0.0 : lost * std::log(1.0 - law_.pd);
      return of_lost + (delivered == 0 ? 0.0 : delivered * std::log(law_.pd));
    }
    const double a = law_.delivered_count, b = law_.lost_count;
    const auto log_beta = [](double p, double q) {
      return std::lgamma(p) + std::lgamma(q) - std::lgamma(p + q);
    };
    mean = (a + delivered) / (a + b + delivered + lost);
    return log_beta(a + delivered, b + lost) - log_beta(a, b);
  }

  const LawCase& law_;
  const Eigen::Index K_;
  std::vector<StepHypothesis> sequence_;
  std::vector<std::vector<Association>> associations_;
  std::vector<Weighed> all_;
};

// Adds the moments of the variables from first on.
void add(const Weighed& sequence, double weight, Eigen::Index first, Eigen::VectorXd& mean,
         Eigen::MatrixXd& square) {
  const Eigen::Index size = mean.size();
  const Eigen::VectorXd part = sequence.mean.segment(first, size);
  mean += weight * part;
  square +=
      weight * (sequence.covariance.block(first, first, size, size) + part * part.transpose());
}

}  // namespace

LawPosterior enumerate_sequences(const LawCase& law, std::size_t num_steps) {
  const Enumeration enumeration(law, num_steps);
  const Eigen::Index n = law.n(), size = n + law.m();
  LawPosterior sum;
  sum.mean0 = Eigen::VectorXd::Zero(n);
  sum.square0 = Eigen::MatrixXd::Zero(n, n);
  sum.mean1 = Eigen::VectorXd::Zero(size);
  sum.square1 = Eigen::MatrixXd::Zero(size, size);
  if (num_steps > 1) {
    sum.mean_before = Eigen::VectorXd::Zero(law.m());
    sum.square_before = Eigen::MatrixXd::Zero(law.m(), law.m());
  }
  sum.attack_probability.assign(law.attacks.size(), 0.0);
  sum.packet_probability.assign(law.steps[num_steps - 1].packets.size(), 0.0);
  double largest = -std::numeric_limits<double>::infinity(), total = 0.0, calm = 0.0;
  for (const Weighed& sequence : enumeration.all()) {
    largest = std::max(largest, sequence.log_weight);
  }
  for (const Weighed& sequence : enumeration.all()) {
    const double weight = std::exp(sequence.log_weight - largest);
    total += weight;
    sum.delivery_probability += weight * sequence.mean_delivery;
    for (const int p : sequence.last_authentic) {
      sum.packet_probability[static_cast<std::size_t>(p)] += weight;
    }
    if (sequence.attack_before != kCalm) {
      sum.r_before += weight;
      add(sequence, weight, size, sum.mean_before, sum.square_before);
    }
    if (sequence.last_attack == kCalm) {
      calm += weight;
      add(sequence, weight, 0, sum.mean0, sum.square0);
    } else {
      sum.r += weight;
      sum.attack_probability[static_cast<std::size_t>(sequence.last_attack)] += weight;
      add(sequence, weight, 0, sum.mean1, sum.square1);
    }
  }
  if (calm > 0.0) {
    sum.mean0 /= calm;
    sum.square0 /= calm;
  }
  if (sum.r > 0.0) {
    sum.mean1 /= sum.r;
    sum.square1 /= sum.r;
    for (double& probability : sum.attack_probability) probability /= sum.r;
  }
  if (sum.r_before > 0.0) {
    sum.mean_before /= sum.r_before;
    sum.square_before /= sum.r_before;
    sum.r_before /= total;
  }
  for (double& probability : sum.packet_probability) probability /= total;
  sum.r /= total;
  sum.delivery_probability /= total;
  return sum;
}

}  // namespace holdfast::testing
