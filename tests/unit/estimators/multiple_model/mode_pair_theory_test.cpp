// When two modes leave no doubt about the state: pairs whose answer can be seen, and the zeros of
// one topology.

#include "estimators/mode_pair_theory.h"

#include <algorithm>
#include <vector>

#include "common/models/three_area/three_area_model.h"
#include "common/random_stream.h"
#include "estimators/mode_theory.h"
#include "tests/support/catch.h"

namespace holdfast {
namespace {

using Matrix = Eigen::MatrixXd;

// One state; its sensor and its actuator can be attacked.
SystemModel scalar(double a, const std::vector<int>& channels) {
  SystemModel model;
  model.A = Matrix::Constant(1, 1, a);
  model.C = Matrix::Ones(1, 1);
  model.G = (Matrix(1, 2) << 0.0, 1.0).finished();
  model.H = (Matrix(1, 2) << 1.0, 0.0).finished();
  model.Q = model.R = Matrix::Ones(1, 1);
  return model.with_attack_channels(channels);
}

const std::vector<int> kNone = {}, kSensor = {0}, kActuator = {1};

SystemModel random_model(std::uint32_t run) {
  const RandomStream stream(7, run, "test/pairs");
  std::uint64_t draw = 0;
  const auto normal = [&](Eigen::Index rows, Eigen::Index columns) {
    Matrix matrix(rows, columns);
    for (Eigen::Index i = 0; i < matrix.size(); ++i) matrix.data()[i] = stream.normal(1, draw++);
    return matrix;
  };
  SystemModel model;
  model.A = 0.6 * normal(3, 3);
  model.C = normal(2, 3);
  model.G = Matrix::Zero(3, 4);
  model.G.leftCols(2) = normal(3, 2);
  model.H = Matrix::Zero(2, 4);
  model.H.rightCols(2) = Matrix::Identity(2, 2);
  model.Q = Matrix::Identity(3, 3);
  model.R = Matrix::Identity(2, 2);
  return model;
}

}  // namespace

TEST_CASE("two topologies of one state: what both can show for ever") {
  // A sensor that may say anything in both: the states go their own ways, and die out or do not.
  CHECK(is_state_common(scalar(0.5, kSensor), scalar(0.3, kSensor)));
  CHECK_FALSE(is_state_common(scalar(0.5, kSensor), scalar(1.2, kSensor)));
  CHECK_FALSE(is_state_common(scalar(1.0, kSensor), scalar(0.3, kSensor)));
  // A sensor that is believed in both says what the state is, however it got there.
  CHECK(is_state_common(scalar(0.5, kActuator), scalar(1.2, kActuator)));
  CHECK(is_state_common(scalar(0.5, kNone), scalar(1.2, kNone)));
  // Believed in the one only: what it shows may be the true state, which an actuator moves at will,
  // or a lie about another one that dies out.
  CHECK_FALSE(is_state_common(scalar(0.5, kActuator), scalar(0.3, kSensor)));
  // With no actuator: a decay that is true, or a lie about another one.
  CHECK(is_state_common(scalar(0.5, kNone), scalar(0.3, kSensor)));
  CHECK_FALSE(is_state_common(scalar(1.2, kNone), scalar(0.3, kSensor)));
  CHECK_FALSE(is_state_common(scalar(0.3, kSensor), scalar(1.2, kNone)));
}

TEST_CASE("in one topology: strong detectability of the channels of both modes") {
  const std::vector<std::vector<int>> sets = {{0}, {1}, {2}, {3}, {}};
  int num_told = 0, num_alike = 0;
  for (std::uint32_t run = 1; run <= 60; ++run) {
    const SystemModel model = random_model(run);
    for (const auto& one : sets) {
      for (const auto& other : sets) {
        if (one >= other) continue;
        std::vector<int> together = one;
        together.insert(together.end(), other.begin(), other.end());
        std::ranges::sort(together);
        const bool expected =
            analyse_mode(model.with_attack_channels(together)).is_strongly_detectable();
        INFO("run " << run);
        CHECK(is_state_common(model.with_attack_channels(one), model.with_attack_channels(other)) ==
              expected);
        ++(expected ? num_told : num_alike);
      }
    }
  }
  CHECK(num_told > 100);
  CHECK(num_alike > 100);
}

TEST_CASE(
    "three areas: whatever is added to the frequencies, no pair of breaker modes hides the state") {
  const ThreeAreaOptions options;
  const std::vector<std::string> ties = {"111", "010", "001", "100", "000", "011", "110", "101"};
  for (const std::string& one : ties) {
    for (const std::string& other : ties) {
      INFO(one << " and " << other);
      CHECK(is_state_common(make_three_area_model(options, one),
                            make_three_area_model(options, other)));
    }
  }
}

}  // namespace holdfast
