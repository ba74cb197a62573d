#include "tests/unit/estimators/baselines/baseline_cases.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace holdfast::testing {

SystemModel small_model(bool has_feedthrough) {
  SystemModel model;
  model.A.resize(3, 3);
  model.A << 0.9, 0.3, 0.0, -0.2, 0.8, 0.1, 0.05, 0.0, 0.7;
  model.C.resize(4, 3);
  model.C << 1.0, 0.0, 0.2, 0.0, 1.0, 0.0, 0.1, 0.0, 1.0, 0.5, -0.5, 0.3;
  model.G.resize(3, 2);
  model.G << 0.5, 0.0, 0.2, 1.0, 0.0, -0.4;
  model.H = Eigen::MatrixXd::Zero(4, 2);
  if (has_feedthrough) model.H << 1.0, 0.0, 0.0, 0.8, -0.5, 0.3, 0.2, 1.0;
  model.Q.resize(3, 3);
  model.Q << 0.04, 0.01, 0.0, 0.01, 0.05, 0.005, 0.0, 0.005, 0.03;
  model.R.resize(4, 4);
  model.R << 0.10, 0.02, 0.0, 0.0, 0.02, 0.08, 0.0, 0.01, 0.0, 0.0, 0.12, 0.0, 0.0, 0.01, 0.0, 0.09;
  return model;
}

SystemModel as_functions(const SystemModel& linear) {
  SystemModel model = linear;
  model.transition = [linear](const auto& x, const auto& a, auto& next) {
    next = linear.A * x + linear.G * a;
  };
  model.transition_jacobian = [linear](const auto&, const auto&, auto& F) {
    F << linear.A, linear.G;
  };
  model.measurement = [linear](const auto& x, const auto& a, auto& y) {
    y = linear.C * x + linear.H * a;
  };
  model.measurement_jacobian = [linear](const auto&, const auto&, auto& J) {
    J << linear.C, linear.H;
  };
  return model;
}

void add_packet(MeasurementSet& set, int source, const std::vector<double>& values,
                std::int64_t rx_index) {
  Packet packet;
  packet.source = source;
  packet.rx_index = rx_index;
  set.add(packet, values);
}

std::vector<double> part_of(const Eigen::VectorXd& y, const std::vector<int>& rows) {
  std::vector<double> values;
  for (const int row : rows) values.push_back(y[row]);
  return values;
}

MeasurementSet empty_set(std::int64_t step) {
  MeasurementSet set;
  set.clear(step, 1000 * step);
  return set;
}

MeasurementSet set_of(std::int64_t step, const Eigen::VectorXd& y, const Rows& rows) {
  MeasurementSet set = empty_set(step);
  for (std::size_t s = 0; s < rows.size(); ++s) {
    add_packet(set, static_cast<int>(s), part_of(y, rows[s]), 10 * step + static_cast<int>(s));
  }
  return set;
}

Eigen::VectorXd sample(const Gaussian& gaussian, const RandomStream& stream, std::uint32_t step,
                       std::uint64_t first_draw) {
  Eigen::VectorXd normals(gaussian.mean.size());
  for (Eigen::Index i = 0; i < normals.size(); ++i) {
    normals[i] = stream.normal(step, first_draw + static_cast<std::uint64_t>(i));
  }
  return gaussian.mean + gaussian.covariance.llt().matrixL() * normals;
}

Gaussian centred(const Eigen::MatrixXd& covariance) {
  return {Eigen::VectorXd::Zero(covariance.rows()), covariance};
}

Path::Path(const SystemModel& model, const Gaussian& start, const Gaussian& prior,
           const std::vector<bool>& attacked, std::uint32_t run) {
  const RandomStream stream(3, run, "test/path");
  Eigen::VectorXd state = sample(start, stream, 0, 0);
  for (std::size_t i = 0; i < attacked.size(); ++i) {
    const auto k = static_cast<std::uint32_t>(i + 1);
    const Eigen::VectorXd input = attacked[i] ? sample(prior, stream, k, 0)
                                              : Eigen::VectorXd::Zero(model.num_attack_channels());
    x.push_back(state);
    a.push_back(input);
    y.push_back(model.C * state + model.H * input + sample(centred(model.R), stream, k, 100));
    state = model.A * state + model.G * input + sample(centred(model.Q), stream, k, 200);
  }
}

MeasurementSet set_at(const Path& path, int step, const Rows& rows) {
  return set_of(step, path.y[static_cast<std::size_t>(step - 1)], rows);
}

Batch::Batch(const SystemModel& model, const Gaussian& start, const Gaussian& prior,
             const std::vector<bool>& attacked)
    : model_(model), steps_(static_cast<int>(attacked.size())) {
  const int n = model.num_states(), m = model.num_attack_channels();
  const int l = model.num_measurements();
  const int size = n + steps_ * (n + m + l);
  mean_.setZero(size);
  covariance_.setZero(size, size);
  mean_.head(n) = start.mean;
  covariance_.topLeftCorner(n, n) = start.covariance;
  Eigen::MatrixXd state = Eigen::MatrixXd::Zero(n, size);
  state.leftCols(n).setIdentity();
  int at = n;
  for (int i = 0; i < steps_; ++i) {
    Eigen::MatrixXd input = Eigen::MatrixXd::Zero(m, size), reading;
    input.middleCols(at, m).setIdentity();
    mean_.segment(at, m) = prior.mean;
    covariance_.block(at, at, m, m) = prior.covariance;
    covariance_.block(at + m, at + m, l, l) = model.R;
    covariance_.block(at + m + l, at + m + l, n, n) = model.Q;
    const double is_attacked = attacked[static_cast<std::size_t>(i)] ? 1.0 : 0.0;
    reading = model.C * state + is_attacked * model.H * input;
    reading.middleCols(at + m, l).setIdentity();
    states_.push_back(state);
    inputs_.push_back(input);
    readings_.push_back(reading);
    state = (model.A * state + is_attacked * model.G * input).eval();
    state.middleCols(at + m + l, n).setIdentity();
    at += n + m + l;
  }
}

void Batch::observe(int step, const std::vector<int>& rows, const Eigen::VectorXd& y) {
  for (const int row : rows) {
    observed_.push_back(readings_[static_cast<std::size_t>(step - 1)].row(row));
    values_.push_back(y[row]);
  }
}

Gaussian Batch::posterior(int step, int input_step) const {
  Eigen::MatrixXd wanted = states_[static_cast<std::size_t>(step - 1)];
  if (input_step > 0) {
    const Eigen::MatrixXd state = wanted;
    wanted.resize(state.rows() + model_.num_attack_channels(), state.cols());
    wanted << state, inputs_[static_cast<std::size_t>(input_step - 1)];
  }
  Gaussian result{wanted * mean_, wanted * covariance_ * wanted.transpose()};
  if (observed_.empty()) return result;
  const Eigen::MatrixXd Y = all_observed();
  const Eigen::MatrixXd cross = Y * covariance_ * wanted.transpose();
  const Eigen::LLT<Eigen::MatrixXd> llt(Y * covariance_ * Y.transpose());
  result.mean += cross.transpose() * llt.solve(innovation(Y));
  result.covariance -= cross.transpose() * llt.solve(cross);
  return result;
}

double Batch::log_likelihood() const {
  if (observed_.empty()) return 0.0;
  const Eigen::MatrixXd Y = all_observed();
  const Eigen::LLT<Eigen::MatrixXd> llt(Y * covariance_ * Y.transpose());
  const Eigen::VectorXd whitened = llt.matrixL().solve(innovation(Y));
  return -0.5 * whitened.squaredNorm() -
         0.5 * static_cast<double>(Y.rows()) * std::log(2.0 * std::numbers::pi) -
         Eigen::MatrixXd(llt.matrixL()).diagonal().array().log().sum();
}

Eigen::MatrixXd Batch::all_observed() const {
  Eigen::MatrixXd Y(observed_.size(), mean_.size());
  for (std::size_t i = 0; i < observed_.size(); ++i) {
    Y.row(static_cast<Eigen::Index>(i)) = observed_[i];
  }
  return Y;
}

Eigen::VectorXd Batch::innovation(const Eigen::MatrixXd& Y) const {
  return Eigen::Map<const Eigen::VectorXd>(values_.data(), Y.rows()) - Y * mean_;
}

double difference(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  REQUIRE(a.rows() == b.rows());
  REQUIRE(a.cols() == b.cols());
  if (a.size() == 0) return 0.0;
  return (a - b).cwiseAbs().maxCoeff() / std::max(1.0, b.cwiseAbs().maxCoeff());
}

double difference(const Estimate& estimate, const Gaussian& wanted) {
  return std::max(difference(estimate.mean, wanted.mean),
                  difference(estimate.covariance, wanted.covariance));
}

double nees(const Eigen::VectorXd& x, const Eigen::VectorXd& mean,
            const Eigen::MatrixXd& covariance) {
  return covariance.llt().matrixL().solve(x - mean).squaredNorm();
}

}  // namespace holdfast::testing
