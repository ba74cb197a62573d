#pragma once

#include <Eigen/Core>
#include <vector>

#include "tests/unit/estimators/hybrid_bernoulli_laws/law_case.h"

namespace holdfast::testing {

/// Equidistant points.
struct GridAxis {
  double low = 0.0, spacing = 1.0;
  int size = 1;
  double at(int i) const { return low + spacing * i; }
};

/// Fine and wide enough for the scalar cases: the routes agree to 1e-9.
inline constexpr GridAxis kAxisX{-9.0, 0.3, 65}, kAxisA{-7.6, 0.4, 40};
/// For two channels at once: to 1e-7.
inline constexpr GridAxis kCoarseAxisA{-6.6, 0.47, 29};

/// The exact hybrid Bernoulli recursion for a scalar state, by integration on a grid.
///
/// Correction: Theorems 1 and 2 of paper 000; prediction: eqs. (49)-(53), without feedthrough
/// (62)-(68). The integrands are smooth and die out within the axes, so that the trapezoidal rule
/// converges faster than any power of the spacing. An unknown delivery probability is integrated
/// over too, by Gauss-Legendre: all integrands are polynomials in it when the counts of its beta
/// prior are whole numbers. A packet's posterior is that of the associations in which it is
/// authentic. With direct feedthrough it also looks one step back.
class GridRecursion {
 public:
  /// Preconditions: n = 1. Every channel of an attack has the axis a.
  GridRecursion(const LawCase& law, const GridAxis& x, const GridAxis& a);

  /// Predicts (but not before the first step) and corrects.
  LawPosterior step(const LawStep& step);

 private:
  // An attack's points, [x; a] for every a, and what x they lead to.
  struct AttackGrid {
    Eigen::MatrixXd a;         // [m x number of points], over all channels
    Eigen::VectorXd density;   // of the prior at each point
    double cell = 1.0;         // spacing to the power of the number of its channels
    Eigen::MatrixXd transfer;  // [x x (x, a)]: N(x+; A x + G a, Q) times the spacing of x
  };
  // All that is known given one value of pd.
  struct Node {
    double pd = 1.0, weight = 1.0, log_evidence = 0.0, r = 0.0;
    Eigen::VectorXd p0;               // over x
    std::vector<Eigen::MatrixXd> p1;  // of each attack and jointly with it: [x x a]
    // Raw moments of [1; a] of the step before, in the light of this one: the probability of an
    // attack then in the corner.
    Eigen::MatrixXd before;
    std::vector<double> packet_probability;
  };
  struct Explanation;

  AttackGrid make_attack_grid(const AttackLaw& attack) const;
  std::vector<Explanation> explanations(const LawStep& step) const;
  void start(Node& node) const;
  void predict(Node& node) const;
  void look_back(Node& node, const std::vector<Explanation>& all) const;
  void judge(Node& node, const std::vector<Explanation>& all, std::size_t num_packets) const;
  void correct(Node& node, const std::vector<Explanation>& all) const;
  LawPosterior posterior() const;
  double likelihood(const Node& node, const std::vector<Explanation>& all, double x,
                    const Eigen::VectorXd& a) const;
  void add_moments(const Node& node, double weight, LawPosterior& sum) const;

  LawCase law_;
  GridAxis x_, a_;
  Eigen::MatrixXd transfer0_;  // [x x x]: N(x+; A x, Q) times the spacing
  std::vector<AttackGrid> attacks_;
  std::vector<Node> nodes_;
  bool is_first_ = true;
};

}  // namespace holdfast::testing
