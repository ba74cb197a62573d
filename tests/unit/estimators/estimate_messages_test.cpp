#include "estimators/estimate_messages.h"

#include <holdfast/estimate_t.hpp>
#include <stdexcept>
#include <vector>

#include "tests/support/catch.h"

using namespace holdfast;

namespace {

Estimate full_estimate() {
  Estimate estimate;
  estimate.step = 7;
  estimate.utime = 140000;
  estimate.measurement_seq = 6;
  estimate.outcome = StepOutcome::kRefusedInput;
  estimate.mean = Eigen::Vector3d(1.0, 2.0, 3.0);
  estimate.covariance.resize(3, 3);
  estimate.covariance << 1, 2, 3, 4, 5, 6, 7, 8, 9;  // not symmetric, so that the order shows
  estimate.attack_probability = 0.25;
  estimate.mode_probability = {0.75, 0.25};
  estimate.input_step = 6;
  estimate.input_mean = Eigen::Vector2d(0.5, -0.5);
  estimate.input_covariance = Eigen::Matrix2d::Identity();
  estimate.hypotheses.push_back({"attack", 0.25, estimate.mean, estimate.covariance, 3, 24});
  estimate.packet_rx_index = {100, 102};
  estimate.packet_probability = {0.9, 0.1};
  estimate.innovation = Eigen::Vector2d(0.125, 8.0);
  estimate.innovation_covariance = Eigen::Vector2d(2.0, 3.0).asDiagonal();
  return estimate;
}

}  // namespace

TEST_CASE("an estimate survives the message, encoded and decoded") {
  const Estimate sent = full_estimate();
  estimate_t message;
  message.seq = 3;
  to_message(sent, message);
  CHECK(message.seq == 3);
  CHECK(message.covariance == std::vector<double>{1, 2, 3, 4, 5, 6, 7, 8, 9});  // row by row

  std::vector<char> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  REQUIRE(message.encode(bytes.data(), 0, static_cast<int>(bytes.size())) > 0);
  estimate_t decoded;
  REQUIRE(decoded.decode(bytes.data(), 0, static_cast<int>(bytes.size())) > 0);
  Estimate got;
  from_message(decoded, got);
  CHECK(got.step == 7);
  CHECK(got.utime == 140000);
  CHECK(got.measurement_seq == 6);
  CHECK(got.outcome == StepOutcome::kRefusedInput);
  CHECK(got.mean == sent.mean);
  CHECK(got.covariance == sent.covariance);
  CHECK(got.attack_probability == 0.25);
  CHECK(got.mode_probability == sent.mode_probability);
  CHECK(got.input_step == 6);
  CHECK(got.input_mean == sent.input_mean);
  CHECK(got.input_covariance == sent.input_covariance);
  REQUIRE(got.hypotheses.size() == 1);
  CHECK(got.hypotheses[0].name == "attack");
  CHECK(got.hypotheses[0].probability == 0.25);
  CHECK(got.hypotheses[0].num_components == 3);
  CHECK(got.hypotheses[0].num_candidates == 24);
  CHECK(got.hypotheses[0].mean == sent.mean);
  CHECK(got.hypotheses[0].covariance == sent.covariance);
  CHECK(got.packet_rx_index == sent.packet_rx_index);
  CHECK(got.packet_probability == sent.packet_probability);
  CHECK(got.innovation == sent.innovation);
  CHECK(got.innovation_covariance == sent.innovation_covariance);
}

TEST_CASE("an estimate with nothing optional stays empty") {
  Estimate sent, got = full_estimate();
  estimate_t message;
  to_message(full_estimate(), message);
  to_message(sent, message);  // nothing of the earlier one may stay
  from_message(message, got);
  CHECK(got.mean.size() == 0);
  CHECK(got.covariance.size() == 0);
  CHECK(got.hypotheses.empty());
  CHECK(got.packet_rx_index.empty());
  CHECK(got.attack_probability == -1.0);
  CHECK(got.input_step == -1);
}

TEST_CASE("a message whose lengths do not fit is refused") {
  estimate_t message;
  Estimate got;
  to_message(full_estimate(), message);
  message.covariance.pop_back();
  CHECK_THROWS_AS(from_message(message, got), std::invalid_argument);
  to_message(full_estimate(), message);
  message.outcome = 99;
  CHECK_THROWS_AS(from_message(message, got), std::invalid_argument);
  to_message(full_estimate(), message);
  message.packet_probability.pop_back();
  CHECK_THROWS_AS(from_message(message, got), std::invalid_argument);
}
