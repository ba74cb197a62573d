// Answers that are known: the examples of paper 004 and systems whose zeros can be seen.

#include "estimators/mode_theory.h"

#include <Eigen/QR>
#include <algorithm>
#include <numeric>

#include "common/models/three_area/three_area_model.h"
#include "common/random_stream.h"
#include "estimators/mode_bank.h"
#include "tests/support/catch.h"

namespace holdfast {
namespace {

SystemModel model_of(const Eigen::MatrixXd& A, const Eigen::MatrixXd& C, const Eigen::MatrixXd& G,
                     const Eigen::MatrixXd& H) {
  SystemModel model;
  model.A = A;
  model.C = C;
  model.G = G;
  model.H = H;
  model.Q = 0.01 * Eigen::MatrixXd::Identity(A.rows(), A.rows());
  model.R = 0.01 * Eigen::MatrixXd::Identity(C.rows(), C.rows());
  return model;
}

Eigen::MatrixXd square(double a, double b, double c, double d) {
  return (Eigen::MatrixXd(2, 2) << a, b, c, d).finished();
}

const Eigen::MatrixXd kTwo = Eigen::MatrixXd::Identity(2, 2);
const Eigen::MatrixXd kNoState = Eigen::MatrixXd::Zero(2, 1);

}  // namespace

TEST_CASE("Theorem 1, smart grid: as many attacks as sensors, zeros inside the circle") {
  const ModeTheory theory = analyse_mode(model_of(square(0.9520, 0.0936, -0.9358, 0.8584),
                                                  (Eigen::MatrixXd(1, 2) << 1.0, 0.0).finished(),
                                                  kNoState, Eigen::MatrixXd::Ones(1, 1)));
  // All that is measured is attacked: the zeros are the eigenvalues of A. (The printed zeros belong
  // to a tenth of the time step.)
  REQUIRE(theory.zeros.size() == 2);
  CHECK(std::abs(theory.zeros[0] - std::complex<double>(0.9052, 0.2922)) < 1e-4);
  CHECK(std::abs(theory.zeros[1] - std::complex<double>(0.9052, -0.2922)) < 1e-4);
  CHECK(theory.is_strongly_detectable());
  CHECK(theory.is_correctable());
}

TEST_CASE("Theorem 1, unstable system: zero at 0.1") {
  const ModeTheory theory = analyse_mode(
      model_of(square(1.5, 1.0, 0.0, 0.1), kTwo, square(1, 0, 0, 0), square(0, 0, 0, 1)));
  REQUIRE(theory.zeros.size() == 1);
  CHECK(std::abs(theory.zeros[0] - 0.1) < 1e-9);
  CHECK(theory.is_correctable());
}

TEST_CASE("Theorem 2: one model is enough, or too much") {
  const SystemModel fine = model_of(square(0.1, 1.0, 0.0, 0.2), kTwo, 0.0 * kTwo, kTwo);
  CHECK(analyse_mode(fine).is_correctable());
  const SystemModel both = model_of(square(0.1, 1.0, 0.0, 1.2), kTwo, 0.0 * kTwo, kTwo);
  const ModeTheory theory = analyse_mode(both);
  REQUIRE(theory.zeros.size() == 2);
  CHECK(std::abs(theory.zeros[0] - 1.2) < 1e-9);
  CHECK(std::abs(theory.zeros[1] - 0.1) < 1e-9);
  CHECK_FALSE(theory.is_strongly_detectable());
  for (const int sensor : {0, 1}) {
    CHECK(analyse_mode(both.with_attack_channels({sensor})).is_correctable());
  }
}

TEST_CASE("attacks that are never seen, and inputs that no filter of one step's delay finds") {
  // Two inputs that act alike cannot be told apart at any z.
  const SystemModel alike =
      model_of(square(0.5, 0.0, 0.0, 0.5), kTwo, square(1, 2, 0, 0), 0.0 * kTwo);
  CHECK_FALSE(analyse_mode(alike).is_invertible);
  CHECK_FALSE(analyse_mode(alike).is_strongly_detectable());
  // An input two steps from the output: strongly detectable, but no such filter.
  const SystemModel late =
      model_of(square(0.5, 1.0, 0.0, 0.5), (Eigen::MatrixXd(1, 2) << 1.0, 0.0).finished(),
               (Eigen::MatrixXd(2, 1) << 0.0, 1.0).finished(), Eigen::MatrixXd::Zero(1, 1));
  const ModeTheory theory = analyse_mode(late);
  CHECK(theory.is_strongly_detectable());
  CHECK(theory.undetermined_inputs == std::vector<int>{0});
  CHECK_FALSE(theory.is_correctable());
  // More attacks than sensors.
  CHECK_FALSE(analyse_mode(model_of(kTwo * 0.5, (Eigen::MatrixXd(1, 2) << 1.0, 1.0).finished(),
                                    kTwo, Eigen::MatrixXd::Zero(1, 2)))
                  .is_invertible);
}

TEST_CASE("a zero of the whole matrix is found, a spurious one of its square part is not") {
  // Three sensors, two of them attacked; the mode 0.9 is seen by attacked sensors only.
  SystemModel model =
      model_of(square(0.9, 0.0, 0.0, 0.3), (Eigen::MatrixXd(3, 2) << 1, 1, 1, -1, 0, 1).finished(),
               Eigen::MatrixXd::Zero(2, 2), (Eigen::MatrixXd(3, 2) << 1, 0, 0, 1, 0, 0).finished());
  ModeTheory theory = analyse_mode(model);
  REQUIRE(theory.zeros.size() == 1);
  CHECK(std::abs(theory.zeros[0] - 0.9) < 1e-9);
  model.C(2, 0) = 0.1;  // now it is seen by the third, too
  CHECK(analyse_mode(model).zeros.empty());
}

TEST_CASE(
    "what lies at infinity, however often, is no zero; a zero of a Jordan block counts twice") {
  for (const int n : {2, 4, 6, 8}) {
    // A chain of n: the input is n steps from the output, and there is no finite zero.
    Eigen::MatrixXd A = 0.5 * Eigen::MatrixXd::Identity(n, n);
    A.diagonal(1).setOnes();
    Eigen::MatrixXd C = Eigen::MatrixXd::Zero(1, n), G = Eigen::MatrixXd::Zero(n, 1);
    C(0, 0) = G(n - 1, 0) = 1.0;
    const ModeTheory theory = analyse_mode(model_of(A, C, G, Eigen::MatrixXd::Zero(1, 1)));
    INFO(n);
    CHECK(theory.is_invertible);
    CHECK(theory.zeros.empty());
  }
  const ModeTheory twice =
      analyse_mode(model_of(square(0.6, 1.0, 0.0, 0.6), kTwo, 0.0 * kTwo, kTwo));
  REQUIRE(twice.zeros.size() == 2);
  for (const std::complex<double> zero : twice.zeros) CHECK(std::abs(zero - 0.6) < 1e-6);
}

TEST_CASE("a zero of any multiplicity is found, whatever the coordinates") {
  for (const double zero : {1.2, 1.0, 0.7}) {
    for (const int n : {1, 3, 5, 8}) {
      // A Jordan block whose readings are all attacked: its eigenvalue is a zero n times.
      Eigen::MatrixXd A = zero * Eigen::MatrixXd::Identity(n, n);
      if (n > 1) A.diagonal(1).setOnes();
      const RandomStream stream(7, static_cast<std::uint32_t>(n), "test/rotation");
      Eigen::MatrixXd random(n, n);
      for (Eigen::Index i = 0; i < random.size(); ++i)
        random.data()[i] = stream.normal(1, static_cast<std::uint64_t>(i));
      const Eigen::MatrixXd Q = Eigen::HouseholderQR<Eigen::MatrixXd>(random).householderQ();
      const Eigen::MatrixXd I = Eigen::MatrixXd::Identity(n, n);
      const ModeTheory theory =
          analyse_mode(model_of(Q * A * Q.transpose(), I, Eigen::MatrixXd::Zero(n, n), I));
      INFO(zero << ", " << n << " times");
      CHECK(theory.zeros.size() == static_cast<std::size_t>(n));
      for (const std::complex<double> z : theory.zeros) CHECK(std::abs(z - zero) < 1e-5);
      CHECK(theory.is_strongly_detectable() == (zero < 0.99));
    }
  }
}

TEST_CASE("models needed: Theorem 2, and the refined number without sets that others contain") {
  CHECK(num_models_needed(3, 2, 3, 2, 2, 3) == 30.0);  // 3 * C(5, 2)
  CHECK(num_models_needed(1, 3, 3, 2, 2, 1) == 12.0);
  CHECK(num_models_needed(1, 2, 5, 3, 2, 2) == 25.0);
}

TEST_CASE("divergence: nothing between equals, and what a run says on average") {
  const SystemModel truth =
      model_of(square(0.8, 0.1, 0.0, 0.7), kTwo, 0.0 * kTwo, 0.0 * kTwo).with_attack_channels({});
  SystemModel rival = truth;
  rival.A(0, 0) = 0.3;
  const Gaussian start{Eigen::VectorXd::Zero(2), 0.1 * kTwo};
  const ModeSignals quiet = {[](std::int64_t) { return Eigen::VectorXd(); },
                             [](std::int64_t) { return Eigen::VectorXd(); }};
  const ModeDivergence none = find_divergence(truth, truth, {}, start, quiet, 50);
  CHECK(none.per_step() == 0.0);
  CHECK(none.delay_steps() == -1);
  const ModeDivergence some = find_divergence(truth, rival, {}, start, quiet, 400);
  CHECK(some.delay_steps() > 0);

  // The other route: runs of both filters on readings of the truth.
  InputStateFilter own({truth}, {}), other({rival}, {});
  const RandomStream noise(1, 0, "divergence");
  const std::vector<int> rows = {0, 1};
  double sum = 0.0, squares = 0.0;
  constexpr int kRuns = 400, kSteps = 60;
  for (std::uint32_t run = 0; run < kRuns; ++run) {
    own.start(start);
    other.start(start);
    Eigen::VectorXd x(2);
    std::uint64_t draw = 0;
    const auto normal = [&] { return noise.normal(run, draw++); };
    for (Eigen::Index i = 0; i < 2; ++i) x[i] = std::sqrt(0.1) * normal();
    double ratio = 0.0;
    for (int k = 0; k < kSteps; ++k) {
      if (k > 0) {
        x = (truth.A * x).eval();
        for (Eigen::Index i = 0; i < 2; ++i) x[i] += 0.1 * normal();
      }
      Eigen::VectorXd y = x;
      for (Eigen::Index i = 0; i < 2; ++i) y[i] += 0.1 * normal();
      ratio += own.step(0, rows, y, {}).log_likelihood - other.step(0, rows, y, {}).log_likelihood;
    }
    sum += ratio;
    squares += ratio * ratio;
  }
  const double mean = sum / kRuns;
  const double error = std::sqrt((squares / kRuns - mean * mean) / kRuns);
  double expected = 0.0;
  for (int k = 0; k + 1 < kSteps; ++k) expected += some.log_ratio[static_cast<std::size_t>(k)];
  INFO(mean << " +- " << error << " against " << expected);
  CHECK(std::abs(mean - expected) < 4.0 * error);
  CHECK(expected > 10.0 * error);  // so that the comparison says something
}

TEST_CASE("Theorem 4: with the true mode outside the set, the bank settles on the closest one") {
  // One tie open in truth, while the bank knows all closed, two or three open. All decouple alike.
  const ThreeAreaOptions options;
  const std::vector<std::string> believed = {"111", "010", "001", "100", "000"};
  const ModeSignals quiet = {[](std::int64_t) { return Eigen::VectorXd::Zero(3).eval(); },
                             [](std::int64_t) { return Eigen::VectorXd(); }};
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(12);
  const Gaussian start{zero, 0.1 * Eigen::MatrixXd::Identity(12, 12)};
  std::vector<SystemModel> modes;
  for (const std::string& ties : believed) modes.push_back(make_three_area_model(options, ties));
  std::vector<int> rows(12);
  std::iota(rows.begin(), rows.end(), 0);
  for (const char* const ties : {"011", "101", "110"}) {
    const SystemModel truth = make_three_area_model(options, ties);
    // The same sum of the true mode's own log likelihood stands in all of them.
    std::vector<double> divergence;
    for (const SystemModel& mode : modes) {
      divergence.push_back(find_divergence(truth, mode, {}, start, quiet, 200).per_step());
    }
    const auto closest = std::min_element(divergence.begin(), divergence.end());
    int num_settled = 0;
    constexpr std::uint32_t kRuns = 20;
    for (std::uint32_t run = 0; run < kRuns; ++run) {
      const RandomStream noise(2, run, ties);
      std::uint64_t draw = 0;
      const auto normals = [&](const Eigen::MatrixXd& covariance) {
        Eigen::VectorXd values(12);
        for (Eigen::Index i = 0; i < 12; ++i) {
          values[i] = std::sqrt(covariance(i, i)) * noise.normal(1, draw++);
        }
        return values;
      };
      ModeBank of_run(modes, {});
      of_run.start(start);
      Eigen::VectorXd x = normals(start.covariance);
      for (int k = 0; k < 200; ++k) {
        if (k > 0) x = (truth.A * x + normals(truth.Q)).eval();
        const Eigen::VectorXd y =
            truth.C * x + truth.H * Eigen::Vector3d(3.0, -2.0, 0.1 * k) + normals(truth.R);
        of_run.step(rows, y, {});
      }
      if (of_run.most_probable() == closest - divergence.begin()) ++num_settled;
    }
    INFO(ties << ": closest " << believed[static_cast<std::size_t>(closest - divergence.begin())]
              << " in " << num_settled << " runs");
    CHECK(std::all_of(divergence.begin(), divergence.end(), [](double d) { return d > 0.0; }));
    CHECK(num_settled >= 18);
  }
}

}  // namespace holdfast
