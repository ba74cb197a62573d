// What must hold of the filter of one mode whatever the system: it is the best linear unbiased one.

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/QR>

#include "common/errors.h"

#include "tests/unit/estimators/multiple_model/golden_modes.h"
#include "tests/unit/estimators/multiple_model/random_modes.h"

namespace holdfast {
namespace {

using namespace testing;

struct Readings {
  std::vector<Eigen::VectorXd> y, u;
};

// Not from the model: the laws hold for any readings.
Readings draw_readings(Draws& draws, const SystemModel& model, int num_steps) {
  Readings readings;
  for (int k = 0; k < num_steps; ++k) {
    readings.y.push_back(draws.vector(model.num_measurements()));
    readings.u.push_back(draws.vector(model.num_inputs()));
  }
  return readings;
}

// All states and inputs of a horizon at once, by weighted least squares: x_1 with its prior, the
// part of y_1 that shows inputs, all other readings, and the dynamics between them.
class Batch {
 public:
  Batch(const SystemModel& model, int num_steps)
      : model_(model),
        n_(model.num_states()),
        p_(model.num_attack_channels()),
        num_steps_(num_steps) {}

  void solve(const Gaussian& start, const Readings& readings) {
    add({{x_at(0), Eigen::MatrixXd::Identity(n_, n_)}}, start.covariance, start.mean);
    const std::vector<int> rows = all_rows(model_);
    const DecoupledMode mode = decouple(model_, rows);
    if (mode.num_seen() > 0) {
      add({{x_at(0), mode.C1}, {d_at(0), mode.T1 * model_.H}}, mode.R1,
          mode.T1 * readings.y[0] - known(mode.D1, readings.u[0]));
    }
    for (int k = 1; k < num_steps_; ++k) {
      const auto i = static_cast<std::size_t>(k);
      add({{x_at(k), model_.C}, {d_at(k), model_.H}}, model_.R,
          readings.y[i] - known(model_.D, readings.u[i]));
      add({{x_at(k), Eigen::MatrixXd::Identity(n_, n_)},
           {x_at(k - 1), -model_.A},
           {d_at(k - 1), -model_.G}},
          model_.Q, known(model_.B, readings.u[i - 1]));
    }
    Eigen::MatrixXd all = Eigen::MatrixXd::Zero(num_rows_, num_steps_ * (n_ + p_));
    Eigen::VectorXd right(num_rows_);
    Eigen::Index row = 0;
    for (const Equation& equation : equations_) {
      for (const Part& part : equation.parts) {
        all.block(row, part.at, part.factor.rows(), part.factor.cols()) = part.factor;
      }
      right.segment(row, equation.right.size()) = equation.right;
      row += equation.right.size();
    }
    // The last step's hidden inputs are in no equation: the least-norm solution leaves them out.
    const Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> solver(all);
    solution_ = solver.solve(right);
    const Eigen::MatrixXd inverse = solver.pseudoInverse();
    covariance_ = inverse * inverse.transpose();
  }

  Eigen::VectorXd state(int k) const { return solution_.segment(x_at(k), n_); }
  Eigen::MatrixXd state_covariance(int k) const {
    return covariance_.block(x_at(k), x_at(k), n_, n_);
  }
  Eigen::VectorXd input(int k) const { return solution_.segment(d_at(k), p_); }
  Eigen::MatrixXd input_covariance(int k) const {
    return covariance_.block(d_at(k), d_at(k), p_, p_);
  }

 private:
  struct Part {
    Eigen::Index at;
    Eigen::MatrixXd factor;
  };
  struct Equation {
    std::vector<Part> parts;
    Eigen::VectorXd right;
  };

  Eigen::Index x_at(int k) const { return k * (n_ + p_); }
  Eigen::Index d_at(int k) const { return k * (n_ + p_) + n_; }
  Eigen::VectorXd known(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& u) const {
    return u.size() == 0 ? Eigen::VectorXd::Zero(matrix.rows() > 0 ? matrix.rows() : n_).eval()
                         : Eigen::VectorXd(matrix * u);
  }
  // Whitened, so that all equations weigh alike.
  void add(const std::vector<Part>& parts, const Eigen::MatrixXd& covariance,
           const Eigen::VectorXd& right) {
    const Eigen::LLT<Eigen::MatrixXd> noise(covariance);
    Equation& equation = equations_.emplace_back();
    for (const Part& part : parts) {
      equation.parts.push_back({part.at, noise.matrixL().solve(part.factor)});
    }
    equation.right = noise.matrixL().solve(right);
    num_rows_ += right.size();
  }

  const SystemModel& model_;
  Eigen::Index n_, p_;
  int num_steps_;
  std::vector<Equation> equations_;
  Eigen::Index num_rows_ = 0;
  Eigen::MatrixXd covariance_;
  Eigen::VectorXd solution_;
};

}  // namespace

TEST_CASE("the filter is batch least squares over all states and inputs") {
  struct Sizes {
    int n, l, p, rank, known;
  };
  // No input, all hidden, all seen, some of each, as many inputs as readings.
  const std::vector<Sizes> cases = {{4, 3, 0, 0, 1}, {4, 3, 2, 0, 1}, {4, 4, 2, 2, 1},
                                    {5, 4, 3, 1, 2}, {6, 5, 3, 2, 1}, {3, 3, 3, 1, 1},
                                    {3, 2, 2, 2, 1}};
  Draws draws("batch");
  constexpr int kSteps = 6;
  for (const Sizes& sizes : cases) {
    for (int repeat = 0; repeat < 5; ++repeat) {
      INFO("n " << sizes.n << " l " << sizes.l << " p " << sizes.p << " rank " << sizes.rank);
      const SystemModel model =
          random_mode(draws, sizes.n, sizes.l, sizes.p, sizes.rank, sizes.known);
      const Gaussian start{draws.vector(sizes.n), draws.covariance(sizes.n, 0.5)};
      const Readings readings = draw_readings(draws, model, kSteps);
      InputStateRule rule;
      rule.improves_input = true;
      InputStateFilter filter({model}, rule);
      filter.start(start);
      for (int k = 0; k < kSteps; ++k) {
        const auto i = static_cast<std::size_t>(k);
        filter.step(0, all_rows(model), readings.y[i], readings.u[i]);
        if (k == 0) continue;
        Batch batch(model, k + 1);
        batch.solve(start, readings);
        CHECK(difference(filter.mean(), batch.state(k)) <= 1e-8);
        CHECK(difference(filter.covariance(), batch.state_covariance(k)) <= 1e-8);
        CHECK(difference(filter.previous_input(), batch.input(k - 1)) <= 1e-8);
        CHECK(difference(filter.previous_input_covariance(), batch.input_covariance(k - 1)) <=
              1e-8);
      }
    }
  }
}

TEST_CASE("without unknown inputs it is the Kalman filter, likelihood included") {
  Draws draws("kalman");
  for (int repeat = 0; repeat < 10; ++repeat) {
    const SystemModel model = random_mode(draws, 4, 3, 0, 0, 2);
    InputStateFilter filter({model}, {});
    Eigen::VectorXd x = draws.vector(4);
    Eigen::MatrixXd P = draws.covariance(4, 0.5);
    filter.start({x, P});
    const Readings readings = draw_readings(draws, model, 30);
    for (std::size_t k = 0; k < 30; ++k) {
      const InputStateResult result = filter.step(0, all_rows(model), readings.y[k], readings.u[k]);
      if (k == 0) continue;  // the start is the state after the first readings
      x = model.A * x + model.B * readings.u[k - 1];
      P = model.A * P * model.A.transpose() + model.Q;
      const Eigen::MatrixXd S = model.C * P * model.C.transpose() + model.R;
      const Eigen::VectorXd nu = readings.y[k] - model.C * x - model.D * readings.u[k];
      const Eigen::MatrixXd K = S.llt().solve(model.C * P).transpose();
      const double log_density = -0.5 * (nu.dot(S.llt().solve(nu)) + std::log(S.determinant()) +
                                         3.0 * std::log(2.0 * M_PI));
      x += K * nu;
      P -= K * S * K.transpose();
      CHECK(difference(filter.mean(), x) <= 1e-12);
      CHECK(difference(filter.covariance(), P) <= 1e-12);
      CHECK(std::abs(result.log_likelihood - log_density) <= 1e-12 * std::abs(log_density));
    }
  }
}

TEST_CASE("inputs that the readings do not determine have a wide prior, as a Kalman filter's") {
  // Rows come and go: the reference is a Kalman filter on [x; d] with a fresh d in each step, whose
  // prior variance is that of the filter. It knows no first step without a correction, so the
  // filter's start is the reference's posterior there.
  Draws draws("rows");
  // Inputs that are seen have no prior in the filter. That is no difference as long as the state is
  // known far better than the prior says of them, hence fewer rows lost, and no way back to it.
  const std::vector<std::vector<int>> sparse = {{0, 1, 2, 3}, {0, 2}, {}, {1, 2, 3}, {3}};
  const std::vector<std::vector<int>> dense = {{0, 1, 2, 3}, {0, 1, 2}, {1, 2, 3}, {0, 1, 3}};
  for (int repeat = 0; repeat < 6; ++repeat) {
    const int rank = repeat % 3;
    const auto& patterns = rank == 0 ? sparse : dense;
    SystemModel model = random_mode(draws, 4, 4, 2, rank, 0);
    if (rank == 2) model.G.setZero();
    InputStateRule rule;
    rule.input_std = 1e4;
    InputStateFilter filter({model}, rule);
    const double variance = rule.input_std * rule.input_std;
    Eigen::VectorXd z(6);
    Eigen::MatrixXd Z = Eigen::MatrixXd::Zero(6, 6);
    const Eigen::MatrixXd P0 = draws.covariance(4, 0.5);
    z << draws.vector(4), 0.0, 0.0;
    Z.topLeftCorner(4, 4) = P0;
    Z.bottomRightCorner(2, 2) = variance * Eigen::Matrix2d::Identity();
    filter.start({z.head(4), P0});
    Eigen::MatrixXd CH(4, 6), AG(4, 6);
    CH << model.C, model.H;
    AG << model.A, model.G;
    const Readings readings = draw_readings(draws, model, 25);
    for (std::size_t k = 0; k < 25; ++k) {
      // No rows in the first step, whose readings the filter does not use for the state.
      const std::vector<int> rows = k == 0 ? std::vector<int>{} : patterns[k % patterns.size()];
      const InputStateResult result = filter.step(0, rows, readings.y[k], {});
      if (k > 0) {
        z.head(4) = (AG * z).eval();
        const Eigen::MatrixXd P = AG * Z * AG.transpose() + model.Q;
        Z.setZero();
        Z.topLeftCorner(4, 4) = P;
        z.tail(2).setZero();
        Z.bottomRightCorner(2, 2) = variance * Eigen::Matrix2d::Identity();
      }
      if (!rows.empty()) {
        Eigen::MatrixXd taken(rows.size(), 6), R(rows.size(), rows.size());
        Eigen::VectorXd y(rows.size());
        for (std::size_t i = 0; i < rows.size(); ++i) {
          const auto a = static_cast<Eigen::Index>(i);
          taken.row(a) = CH.row(rows[i]);
          y[a] = readings.y[k][rows[i]];
          for (std::size_t j = 0; j < rows.size(); ++j) {
            R(a, static_cast<Eigen::Index>(j)) = model.R(rows[i], rows[j]);
          }
        }
        const Eigen::MatrixXd S = taken * Z * taken.transpose() + R;
        const Eigen::MatrixXd K = S.ldlt().solve(taken * Z).transpose();
        z += K * (y - taken * z);
        const Eigen::MatrixXd rest = Eigen::MatrixXd::Identity(6, 6) - K * taken;
        Z = rest * Z * rest.transpose() + K * R * K.transpose();
      }
      INFO("repeat " << repeat << ", k " << k);
      if (k > 0) CHECK(result.kind == InputStateResult::Kind::kCorrected);
      // Errors of the reference itself: a variance of 1e8 beside one of 0.1.
      const double scale = std::max(1.0, filter.covariance().cwiseAbs().maxCoeff());
      CHECK((filter.mean() - z.head(4)).cwiseAbs().maxCoeff() <=
            1e-4 * std::max(1.0, z.head(4).cwiseAbs().maxCoeff()));
      CHECK((filter.covariance() - Z.topLeftCorner(4, 4)).cwiseAbs().maxCoeff() <= 1e-4 * scale);
    }
  }
}

TEST_CASE("a mode in which no filter exists is refused by its name and the input's") {
  SystemModel model;
  model.A = Eigen::MatrixXd::Identity(2, 2);
  model.C = Eigen::MatrixXd::Identity(1, 2);  // x_1 only
  model.G = (Eigen::MatrixXd(2, 2) << 1.0, 0.0, 0.0, 1.0).finished();
  model.H = Eigen::MatrixXd::Zero(1, 2);
  model.Q = Eigen::MatrixXd::Identity(2, 2);
  model.R = Eigen::MatrixXd::Identity(1, 1);
  model.attack_names = {"valve", "pump"};
  const auto text_of = [&model] {
    try {
      InputStateFilter({model}, {}, {"both"});
    } catch (const UsageError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const std::string text = text_of();
  CHECK(text.find("'both'") != std::string::npos);
  CHECK(text.find("pump") != std::string::npos);
  CHECK(text.find("valve") == std::string::npos);
  model.R.setZero();
  CHECK(text_of().find("R must be positive definite") != std::string::npos);
}

TEST_CASE("what is added to attacked sensors moves neither state nor modes") {
  const auto file = golden_file("multiple_model/mm_three_area.json");
  std::vector<SystemModel> modes;
  for (const auto& system : file.at("systems")) modes.push_back(mode_of(system));
  ModeBank quiet(modes, {}), loud(modes, {});
  for (ModeBank* bank : {&quiet, &loud}) {
    bank->start({vector_of(file.at("x0")), matrix_of(file.at("P0"))});
  }
  for (std::size_t k = 0; k < file.at("y").size(); ++k) {
    const Eigen::VectorXd y = vector_of(file.at("y").at(k));
    const Eigen::VectorXd d = Eigen::VectorXd::Constant(3, 100.0 * static_cast<double>(k) - 700.0);
    quiet.step(all_rows(modes[0]), y, {});
    loud.step(all_rows(modes[0]), y + modes[0].H * d, {});
    CHECK(quiet.probability() == loud.probability());
    for (int j = 0; j < quiet.num_modes(); ++j) {
      CHECK(quiet.filter(j).mean() == loud.filter(j).mean());
    }
    // The estimate of the input does move: by what was added.
    const DecoupledMode& mode = loud.filter(0).current();
    const Eigen::VectorXd moved =
        mode.V1 * (loud.filter(0).seen_input() - quiet.filter(0).seen_input());
    CHECK(difference(moved, d) <= 1e-12);
  }
}

TEST_CASE("modes that never change are those of the static bank") {
  const auto file = golden_file("multiple_model/mm_benchmark.json");
  std::vector<SystemModel> modes;
  for (const auto& system : file.at("systems")) modes.push_back(mode_of(system));
  ModeBankOptions options;
  options.floor = 0.0;
  ModeBank still(modes, options);
  options.transition = Eigen::MatrixXd::Identity(5, 5);
  ModeBank mixing(modes, options);
  for (ModeBank* bank : {&still, &mixing}) {
    bank->start({vector_of(file.at("x0")), matrix_of(file.at("P0"))});
  }
  for (std::size_t k = 0; k < file.at("y").size(); ++k) {
    for (ModeBank* bank : {&still, &mixing}) {
      bank->step(all_rows(modes[0]), vector_of(file.at("y").at(k)), vector_of(file.at("u").at(k)));
    }
    for (int j = 0; j < 5; ++j) {
      const auto index = static_cast<std::size_t>(j);
      CHECK(std::abs(still.probability()[index] - mixing.probability()[index]) <= 1e-10);
      CHECK(difference(still.filter(j).mean(), mixing.filter(j).mean()) <= 1e-10);
    }
  }
}

}  // namespace holdfast
