#include "estimators/mode_theory.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "common/random_stream.h"
#include "common/subsets.h"

namespace holdfast {
namespace {

using Complex = std::complex<double>;

// A zero that is found by a square part of the system matrix must be one of the whole.
constexpr double kZeroTolerance = 1e-7;
constexpr double kInfinite = 1e-8;  // eigenvalues of the inverse below this part of its norm
// A zero of multiplicity m is found to the m-th root of the precision only.
constexpr double kSameZero = 0.03;
constexpr std::uint32_t kNumParts = 5;  // random square parts that must agree
constexpr double kPencilTolerance = 1e-10;
constexpr double kNoValue = std::numeric_limits<double>::quiet_NaN();

Eigen::MatrixXd scaled_inputs(const SystemModel& mode) {
  Eigen::MatrixXd GH(mode.G.rows() + mode.H.rows(), mode.G.cols());
  GH << mode.G, mode.H;
  for (Eigen::Index i = 0; i < GH.cols(); ++i) {
    const double norm = GH.col(i).norm();
    if (norm > 0.0) GH.col(i) /= norm;
  }
  return GH;
}

struct ExtremeValues {
  double smallest = 1.0, largest = 1.0;  // singular values
};

// Of the system matrix at z, as a real matrix of twice the size, [Re, -Im; Im, Re], whose singular
// values are the same ones twice.
ExtremeValues singular_values_at(const SystemModel& mode, const Eigen::MatrixXd& GH, Complex z) {
  const Eigen::Index n = mode.A.rows(), l = mode.C.rows();
  const Eigen::Index rows = n + l, columns = n + GH.cols();
  // Far from the origin the identity outweighs all: its rows are brought back to size.
  const double scale = 1.0 / std::max(1.0, std::abs(z));
  Eigen::MatrixXd real = Eigen::MatrixXd::Zero(rows, columns);
  real.topLeftCorner(n, n) = mode.A;
  real.diagonal().head(n).array() -= z.real();
  real.bottomLeftCorner(l, n) = mode.C;
  real.rightCols(GH.cols()) = GH;
  real.topRows(n) *= scale;
  Eigen::MatrixXd whole = Eigen::MatrixXd::Zero(2 * rows, 2 * columns);
  whole.topLeftCorner(rows, columns) = real;
  whole.bottomRightCorner(rows, columns) = real;
  for (Eigen::Index i = 0; i < n; ++i) {
    whole(i, columns + i) = scale * z.imag();
    whole(rows + i, i) = -scale * z.imag();
  }
  const Eigen::VectorXd values = singular_values(whole);
  if (values.size() == 0) return {};
  return {rows < columns ? 0.0 : values[values.size() - 1], values[0]};
}

// Zeros of a random square part of the system matrix: those of the whole, and some more. By shift
// and inversion, so that what lies at infinity becomes 0 (and 1 / 0, roughly, where it is
// repeated).
std::vector<Complex> candidates(const SystemModel& mode, const Eigen::MatrixXd& GH,
                                std::uint32_t attempt) {
  const Eigen::Index n = mode.A.rows(), l = mode.C.rows(), p = GH.cols();
  const RandomStream stream(1, attempt, "theory/compression");
  Eigen::MatrixXd M(p, l);
  for (Eigen::Index i = 0; i < M.size(); ++i) {
    M.data()[i] = stream.normal(1, static_cast<std::uint64_t>(i));
  }
  const double shift = 2.0 + stream.uniform(2, 0);
  Eigen::MatrixXd shifted(n + p, n + p);
  shifted.topLeftCorner(n, n) = mode.A - shift * Eigen::MatrixXd::Identity(n, n);
  shifted.topRightCorner(n, p) = GH.topRows(n);
  shifted.bottomLeftCorner(p, n) = M * mode.C;
  shifted.bottomRightCorner(p, p) = M * GH.bottomRows(l);
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(n + p, n + p);
  right.topLeftCorner(n, n).setIdentity();
  const Eigen::MatrixXd inverted = shifted.partialPivLu().solve(right);
  if (!inverted.allFinite()) return {};
  const Eigen::VectorXcd values =
      Eigen::EigenSolver<Eigen::MatrixXd>(inverted, false).eigenvalues();
  std::vector<Complex> zeros;
  for (const Complex value : values) {
    if (std::abs(value) > kInfinite * inverted.norm()) zeros.push_back(shift + 1.0 / value);
  }
  return zeros;
}

bool is_zero(const SystemModel& mode, const Eigen::MatrixXd& GH, Complex z) {
  const ExtremeValues values = singular_values_at(mode, GH, z);
  return values.smallest <= kZeroTolerance * values.largest;
}

bool is_near(Complex a, Complex b) {
  return std::abs(a - b) <= kSameZero * std::max(1.0, std::abs(a));
}

// Rounding spreads a repeated zero over a circle, whose centre is the zero again.
void centre_repeated(const SystemModel& mode, const Eigen::MatrixXd& GH,
                     std::vector<Complex>& zeros) {
  std::vector<char> is_done(zeros.size(), 0);
  for (std::size_t i = 0; i < zeros.size(); ++i) {
    if (is_done[i] != 0) continue;
    std::vector<std::size_t> circle;
    Complex sum = 0.0;
    for (std::size_t j = i; j < zeros.size(); ++j) {
      if (is_done[j] != 0 || !is_near(zeros[i], zeros[j])) continue;
      circle.push_back(j);
      sum += zeros[j];
    }
    const Complex centre = sum / static_cast<double>(circle.size());
    if (circle.size() < 2 || !is_zero(mode, GH, centre)) continue;
    for (const std::size_t j : circle) {
      zeros[j] = centre;
      is_done[j] = 1;
    }
  }
}

// A zero of the whole is found by every square part; what rounding makes of infinity is not.
std::vector<Complex> invariant_zeros(const SystemModel& mode, const Eigen::MatrixXd& GH) {
  std::vector<Complex> zeros;
  std::vector<std::vector<Complex>> others;
  for (std::uint32_t part = 1; part < kNumParts; ++part)
    others.push_back(candidates(mode, GH, part));
  for (const Complex z : candidates(mode, GH, 0)) {
    std::vector<std::vector<Complex>::iterator> found;
    for (std::vector<Complex>& part : others) {
      const auto nearest = std::min_element(part.begin(), part.end(), [z](Complex a, Complex b) {
        return std::abs(a - z) < std::abs(b - z);
      });
      if (nearest == part.end() || !is_near(z, *nearest)) break;
      found.push_back(nearest);
    }
    if (found.size() < others.size() || !is_zero(mode, GH, z)) continue;
    for (std::size_t part = 0; part < others.size(); ++part) others[part].erase(found[part]);
    zeros.push_back(z);
  }
  centre_repeated(mode, GH, zeros);
  std::sort(zeros.begin(), zeros.end(), [](Complex a, Complex b) {
    if (std::abs(std::abs(a) - std::abs(b)) > 1e-12) return std::abs(a) > std::abs(b);
    return a.imag() > b.imag();
  });
  return zeros;
}

// Truth in one mode and filter in another as one linear system: s = [x; x_hat; d1_hat].
class JointMoments {
 public:
  JointMoments(const SystemModel& truth, const SystemModel& believed, const InputStateRule& rule,
               const Gaussian& start)
      : truth_(truth),
        filter_({believed}, rule),
        rows_(static_cast<std::size_t>(truth.num_measurements())),
        n_(truth.num_states()),
        no_reading_(Eigen::VectorXd::Zero(truth.num_measurements())) {
    std::iota(rows_.begin(), rows_.end(), 0);
    filter_.start(start);
    x_mean_ = start.mean;
    x_covariance_ = start.covariance;
  }

  // E log L of this step's readings; 0 in the first.
  double step(const Eigen::VectorXd& attack, const Eigen::VectorXd& u) {
    const bool is_first = mean_.size() == 0;
    const DecoupledMode* from = is_first ? nullptr : &filter_.current();
    if (filter_.step(0, rows_, no_reading_, u).kind == InputStateResult::Kind::kFailed) {
      return kNoValue;
    }
    const double value = is_first ? begin(attack, u) : advance(*from, attack, u);
    attack_ = attack;
    u_ = u;
    return value;
  }

 private:
  // x_hat is the start itself, d1_hat follows from the reading.
  double begin(const Eigen::VectorXd& attack, const Eigen::VectorXd& u) {
    const DecoupledMode& now = filter_.current();
    const Eigen::Index seen = now.num_seen(), l = truth_.num_measurements();
    mean_ = Eigen::VectorXd::Zero(2 * n_ + seen);
    covariance_ = Eigen::MatrixXd::Zero(mean_.size(), mean_.size());
    mean_.head(n_) = x_mean_;
    mean_.segment(n_, n_) = x_mean_;
    const Eigen::VectorXd y = truth_.C * x_mean_ + offset(attack, u);
    const Eigen::MatrixXd M1T1 = now.M1 * now.T1;
    mean_.tail(seen) = M1T1 * y - now.M1 * (now.C1 * x_mean_);
    if (u.size() > 0) mean_.tail(seen) -= now.M1 * (now.D1 * u);
    Eigen::MatrixXd of_x = Eigen::MatrixXd::Zero(mean_.size(), n_);
    of_x.topRows(n_).setIdentity();
    of_x.bottomRows(seen) = M1T1 * truth_.C;
    Eigen::MatrixXd of_v = Eigen::MatrixXd::Zero(mean_.size(), l);
    of_v.bottomRows(seen) = M1T1;
    covariance_ = of_x * x_covariance_ * of_x.transpose() + of_v * truth_.R * of_v.transpose();
    return 0.0;
  }

  double advance(const DecoupledMode& from, const Eigen::VectorXd& attack,
                 const Eigen::VectorXd& u) {
    const DecoupledMode& now = filter_.current();
    const InputStateGains& gains = filter_.gains();
    const Eigen::Index size = mean_.size(), seen = now.num_seen(), l = truth_.num_measurements();
    // x moves; predicted = A x_hat + G1 d1_hat; y = C x + v; r = T2 y - C2 predicted.
    Eigen::MatrixXd x_of = Eigen::MatrixXd::Zero(n_, size);
    x_of.leftCols(n_) = truth_.A;
    Eigen::VectorXd x_offset = truth_.G * attack_;
    Eigen::MatrixXd predicted_of = Eigen::MatrixXd::Zero(n_, size);
    predicted_of.middleCols(n_, n_) = from.A;
    predicted_of.rightCols(seen) = from.G1;
    Eigen::VectorXd predicted_offset = Eigen::VectorXd::Zero(n_);
    if (u.size() > 0) {
      x_offset += truth_.B * u_;
      predicted_offset = from.B * u_;
    }
    const Eigen::VectorXd y_offset = truth_.C * x_offset + offset(attack, u);
    const Eigen::MatrixXd r_of = now.T2 * truth_.C * x_of - now.C2 * predicted_of;
    const Eigen::MatrixXd r_of_w = now.T2 * truth_.C, r_of_v = now.T2;
    Eigen::VectorXd r_offset = now.T2 * y_offset - now.C2 * predicted_offset;
    if (u.size() > 0) r_offset -= now.D2 * u;
    const Eigen::MatrixXd Kx = gains.Kx, W = gains.W;
    const Eigen::MatrixXd M1T1 = now.M1 * now.T1, M1C1 = now.M1 * now.C1;

    const Eigen::MatrixXd noise_r = r_of * covariance_ * r_of.transpose() +
                                    r_of_w * truth_.Q * r_of_w.transpose() +
                                    r_of_v * truth_.R * r_of_v.transpose();
    const Eigen::VectorXd mean_r = r_of * mean_ + r_offset;
    const double expected = (W * noise_r).trace() + mean_r.dot(W * mean_r);

    Eigen::MatrixXd next(size, size), of_w(size, n_), of_v(size, l);
    Eigen::VectorXd next_offset(size);
    next.topRows(n_) = x_of;
    next.middleRows(n_, n_) = predicted_of + Kx * r_of;
    next.bottomRows(seen) = M1T1 * truth_.C * x_of - M1C1 * next.middleRows(n_, n_);
    of_w.topRows(n_).setIdentity();
    of_w.middleRows(n_, n_) = Kx * r_of_w;
    of_w.bottomRows(seen) = M1T1 * truth_.C - M1C1 * of_w.middleRows(n_, n_);
    of_v.topRows(n_).setZero();
    of_v.middleRows(n_, n_) = Kx * r_of_v;
    of_v.bottomRows(seen) = M1T1 - M1C1 * of_v.middleRows(n_, n_);
    next_offset.head(n_) = x_offset;
    next_offset.segment(n_, n_) = predicted_offset + Kx * r_offset;
    next_offset.tail(seen) = M1T1 * y_offset - M1C1 * next_offset.segment(n_, n_);
    if (u.size() > 0) next_offset.tail(seen) -= now.M1 * (now.D1 * u);
    mean_ = (next * mean_ + next_offset).eval();
    covariance_ = (next * covariance_ * next.transpose() + of_w * truth_.Q * of_w.transpose() +
                   of_v * truth_.R * of_v.transpose())
                      .eval();
    return gains.log_constant - 0.5 * expected;
  }

  // What y has beside C x and noise.
  Eigen::VectorXd offset(const Eigen::VectorXd& attack, const Eigen::VectorXd& u) const {
    Eigen::VectorXd y = truth_.H * attack;
    if (u.size() > 0) y += truth_.D * u;
    return y;
  }

  const SystemModel& truth_;
  InputStateFilter filter_;
  std::vector<int> rows_;
  Eigen::Index n_;
  Eigen::VectorXd no_reading_, x_mean_, mean_, attack_, u_;
  Eigen::MatrixXd x_covariance_, covariance_;
};

}  // namespace

ModeTheory analyse_mode(const SystemModel& mode) {
  ModeTheory theory;
  const Eigen::MatrixXd GH = scaled_inputs(mode);
  const ExtremeValues generic = singular_values_at(mode, GH, Complex(0.8312, 0.4713));
  theory.is_invertible = generic.smallest > kPencilTolerance * generic.largest;
  if (theory.is_invertible) theory.zeros = invariant_zeros(mode, GH);
  std::vector<int> rows(static_cast<std::size_t>(mode.num_measurements()));
  std::iota(rows.begin(), rows.end(), 0);
  const DecoupledMode decoupled = decouple(mode, rows);
  theory.undetermined_inputs = undetermined_inputs(make_transition(decoupled, decoupled));
  return theory;
}

double num_models_needed(int tm, int ta, int ts, int p, int na, int ns) {
  double sum = 0.0;
  const int most = std::min({na, ta, p});
  for (int i = 0; i <= most; ++i) {
    const int sensors = std::min({p - i, ns, ts});
    // With one more actuator and as many sensors the set would still be allowed: that contains it.
    if (sensors < p - i && i < most) continue;
    sum += binomial(ta, i) * binomial(ts, sensors);
  }
  return tm * sum;
}

double ModeDivergence::per_step() const {
  if (log_ratio.empty()) return 0.0;
  const std::size_t first = log_ratio.size() / 2;
  double sum = 0.0;
  for (std::size_t k = first; k < log_ratio.size(); ++k) sum += log_ratio[k];
  return sum / static_cast<double>(log_ratio.size() - first);
}

int ModeDivergence::delay_steps() const {
  const double wanted = std::log(99.0);
  double sum = 0.0;
  int delay = -1;
  for (std::size_t k = 0; k < log_ratio.size(); ++k) {
    sum += log_ratio[k];
    if (!(sum >= wanted)) {
      delay = -1;
    } else if (delay < 0) {
      delay = static_cast<int>(k) + 1;
    }
  }
  return delay;
}

ModeDivergence find_divergence(const SystemModel& truth, const SystemModel& rival,
                               const InputStateRule& rule, const Gaussian& start,
                               const ModeSignals& signals, int num_steps) {
  JointMoments own(truth, truth, rule, start), other(truth, rival, rule, start);
  ModeDivergence divergence;
  for (std::int64_t step = 1; step <= num_steps; ++step) {
    const Eigen::VectorXd attack = signals.attack(step), u = signals.input(step);
    const double of_own = own.step(attack, u), of_other = other.step(attack, u);
    if (step == 1) continue;
    const bool is_lost = std::isfinite(of_own) && !std::isfinite(of_other);
    divergence.log_ratio.push_back(is_lost ? std::numeric_limits<double>::infinity()
                                           : of_own - of_other);
  }
  return divergence;
}

}  // namespace holdfast
