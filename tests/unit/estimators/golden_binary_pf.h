#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/measurement_set.h"
#include "common/models/binary_target/binary_target_model.h"
#include "estimators/particle_kernel.h"
#include "estimators/particle_set.h"
#include "tests/support/catch.h"
#include "tests/support/golden.h"

namespace holdfast::testing {

inline nlohmann::json golden(const std::string& file) {
  return golden_file("binary_pf/" + file);
}

inline BinaryTargetModel model_of(const nlohmann::json& params) {
  BinaryTargetModel model;
  model.has_radio_channel = true;
  model.sensor_positions_m = params.at("sensors").get<std::vector<std::vector<double>>>();
  model.source_power = params.at("Upsilon");
  model.reference_distance_m = params.at("d0");
  model.decay_exponent = params.at("lambda");
  model.threshold = params.at("T_delta");
  model.radio_gain = params.at("tau");
  model.radio_noise_std = params.at("sigma_eps");
  model.glint = {params.at("beta"), params.at("u1"), params.at("Sigma1"), params.at("u2"),
                 params.at("Sigma2")};
  return model;
}

inline BinaryTargetModel::Attack attack_of(const nlohmann::json& params) {
  const std::size_t num_sensors = params.at("sensors").size();
  BinaryTargetModel::Attack attack;
  attack.dos.assign(num_sensors, params.at("phi_dos"));
  attack.deception.assign(num_sensors, params.at("varphi_deception"));
  attack.flip.assign(num_sensors, params.at("alpha_flip"));
  attack.deception_low = params.at("a");
  attack.deception_high = params.at("b");
  return attack;
}

/// The paper's sixteen sensors on a square grid (spec: {10, 30, 50, 70} m, x major).
inline BinaryTargetModel grid_model(bool has_radio_channel) {
  BinaryTargetModel model;
  model.has_radio_channel = has_radio_channel;
  for (const double x : {10.0, 30.0, 50.0, 70.0}) {
    for (const double y : {10.0, 30.0, 50.0, 70.0}) model.sensor_positions_m.push_back({x, y});
  }
  return model;
}

/// Table I's attack: every probability 0.1.
inline BinaryTargetModel::Attack table_attack(std::size_t num_sensors = 16) {
  BinaryTargetModel::Attack attack;
  attack.dos.assign(num_sensors, 0.1);
  attack.deception = attack.flip = attack.dos;
  return attack;
}

inline ParticleSet particles_of(const std::vector<std::vector<double>>& rows) {
  ParticleSet particles(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    for (std::size_t c = 0; c < 4; ++c) particles.component[c][i] = rows[i][c];
  }
  return particles;
}

inline void add_packet(MeasurementSet& set, int source, double value, std::int64_t rx_index = -1) {
  Packet packet;
  packet.source = source;
  packet.rx_index = rx_index;
  set.add(packet, std::span<const double>(&value, 1));
}

inline MeasurementSet set_of(const std::vector<double>& readings) {
  MeasurementSet set;
  set.clear(1, 1);
  for (std::size_t s = 0; s < readings.size(); ++s)
    add_packet(set, static_cast<int>(s), readings[s]);
  return set;
}

/// Error as the golden files state theirs: relative to max(1, |value|).
inline double golden_error(double value, double wanted) {
  return std::abs(value - wanted) / std::max(1.0, std::abs(wanted));
}

inline std::array<double*, 4> pointers(ParticleSet& set) {
  return {set.component[0].data(), set.component[1].data(), set.component[2].data(),
          set.component[3].data()};
}

}  // namespace holdfast::testing
