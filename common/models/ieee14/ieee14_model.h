#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/configuration.h"
#include "common/models/system_model.h"

namespace holdfast {

/// Keys of a plant or belief with the IEEE 14-bus power network of papers 000 and 003.
struct Ieee14Options {
  enum class Preset {
    kDrift,     // light rotors, of paper 000: angles near pi/2 at k = 100
    kRealistic  // H = 5 s at 60 Hz, of paper 003
  };

  Preset preset = Preset::kDrift;
  bool nonlinear = false;
  std::vector<int> victims = {3, 9};  // buses 1..14 whose load the attack alters, one channel each
  double feedthrough_gain = 5.0;      // h; 0: the attack reaches no meter
  double step_s = 0.01;
  double process_noise_intensity = 0.01;  // sigma_w^2 per second
  double measurement_noise_std = 0.1;     // sigma_v
  std::vector<double> inertia_pu_s2;      // M [5]; empty: the preset's
  std::vector<double> damping_pu_s;       // D [5]; empty: the preset's
  int substeps = 4;                       // of a step of the nonlinear equation

  void read(ConfigurationMap& map);
};

/// The reduced network: Laplacian between the generators, and how a load at a bus reaches them.
struct Ieee14Network {
  Eigen::MatrixXd laplacian;      // L_red = L_gg - L_ge L_ee^-1 L_eg, [5 x 5]
  Eigen::MatrixXd participation;  // W [5 x 14]: W_g = I, W_e = -L_ge L_ee^-1; columns sum to 1
};

/// Kron reduction of the 20 branches of MATPOWER's case14 to the generator buses 1, 2, 3, 6, 8;
/// every branch has impedance j1 p.u., every bus 1 p.u. voltage (paper 000, VI-B).
Ieee14Network ieee14_network();

/// The network as a SystemModel:
///
///   delta' = omega,  M omega' = -D omega - L_red delta + B a,  B = -W[:, victims]
///   y = [delta; omega] + h [B; B] a + v
///
/// discretised by an exact zero-order hold; nonlinear: by SwingEquation, whose linearisation that
/// is. State: delta_j [rad] then omega_j [rad/s] of generators j = 1..5, deviations from nominal.
/// a: load added at each victim [p.u., base 100 MVA]. Q = sigma_w^2 step_s I, R = sigma_v^2 I.
///
/// The papers print neither M, D nor the way in which the attack reaches the meters: presets and
/// h [B; B] are this project's resolution (docs of the hybrid Bernoulli filter say why).
/// Throws UsageError for a bus outside 1..14 and for M, D or a number of a wrong size or sign.
SystemModel make_ieee14_model(const Ieee14Options& options);

}  // namespace holdfast
