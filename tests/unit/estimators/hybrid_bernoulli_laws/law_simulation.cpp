#include "tests/unit/estimators/hybrid_bernoulli_laws/law_simulation.h"

#include <Eigen/Cholesky>
#include <functional>

#include "common/random_stream.h"

namespace holdfast::testing {
namespace {

class Simulation {
 public:
  Simulation(const LawCase& law, std::uint32_t run)
      : law_(law), noise_(4, run, "law/noise"), chance_(4, run, "law/chance") {}

  void next(CorrectionLaw correction, int most_packets, LawRun& run) {
    normals_ = 0;
    uniforms_ = 0;
    const LawTruth* before = run.truth.empty() ? nullptr : &run.truth.back();
    LawTruth truth;
    double attacked = law_.start_probability;
    if (before != nullptr) attacked = before->is_attacked ? law_.ps : law_.pb;
    truth.is_attacked = uniform() < attacked;
    truth.a = Eigen::VectorXd::Zero(law_.m());
    const bool goes_on = before != nullptr && before->is_attacked;
    if (truth.is_attacked) draw_attack(goes_on ? before->attack : -1, truth);
    if (before == nullptr) {
      truth.x = law_.start_mean + gaussian(law_.start_covariance);
    } else {
      truth.x = law_.model.A * before->x + gaussian(law_.model.Q) +
                law_.model.G * (law_.is_direct ? before->a : truth.a);
    }
    Eigen::VectorXd y = law_.model.C * truth.x + gaussian(law_.model.R);
    if (law_.is_direct) y += law_.model.H * truth.a;
    LawStep step{correction, {}};
    for (std::size_t source = 0; source < law_.rows.size(); ++source) {
      send(static_cast<int>(source), y(law_.rows[source]), most_packets, step, truth);
    }
    run.steps.push_back(step);
    run.truth.push_back(truth);
    ++step_;
  }

 private:
  double uniform() { return chance_.uniform(step_, uniforms_++); }

  Eigen::VectorXd gaussian(const Eigen::MatrixXd& covariance) {
    Eigen::VectorXd white(covariance.rows());
    for (double& value : white) value = noise_.normal(step_, normals_++);
    return covariance.llt().matrixL() * white;
  }

  std::size_t pick(std::size_t size, const std::function<double(std::size_t)>& probability) {
    double left = uniform();
    for (std::size_t i = 0; i + 1 < size; ++i) {
      left -= probability(i);
      if (left < 0.0) return i;
    }
    return size - 1;
  }

  void draw_attack(int before, LawTruth& truth) {
    const std::size_t v = pick(law_.attacks.size(), [&](std::size_t i) {
      return before < 0 ? law_.attacks[i].probability
                        : law_.attack_probability(i, static_cast<std::size_t>(before));
    });
    const AttackLaw& attack = law_.attacks[v];
    const std::size_t t =
        pick(attack.terms.size(), [&](std::size_t i) { return attack.terms[i].weight; });
    truth.attack = static_cast<int>(v);
    truth.a(attack.channels) = attack.terms[t].mean + gaussian(attack.terms[t].covariance);
  }

  void send(int source, const Eigen::VectorXd& y, int most_packets, LawStep& step,
            LawTruth& truth) {
    const bool is_injection = step.correction == kInjection;
    const int count = is_injection ? 1 + static_cast<int>(uniform() * most_packets) : 1;
    const bool is_there = uniform() < (is_injection ? law_.pd : 1.0 - law_.pf);
    const int place = is_there ? static_cast<int>(uniform() * count) : -1;
    for (int p = 0; p < count; ++p) {
      LawPacket packet{y, source};
      if (p != place) {
        const auto& rows = law_.rows[static_cast<std::size_t>(source)];
        for (std::size_t i = 0; i < rows.size(); ++i) {
          const double low = law_.box_low[rows[i]], high = law_.box_high[rows[i]];
          packet.y[static_cast<Eigen::Index>(i)] = low + (high - low) * uniform();
        }
      }
      step.packets.push_back(packet);
      truth.authentic.push_back(p == place);
    }
  }

  const LawCase& law_;
  RandomStream noise_, chance_;
  std::uint32_t step_ = 1;
  std::uint64_t normals_ = 0, uniforms_ = 0;
};

}  // namespace

LawRun simulate(const LawCase& law, std::uint32_t run, int num_steps, CorrectionLaw correction,
                int most_packets) {
  Simulation simulation(law, run);
  LawRun result;
  for (int k = 0; k < num_steps; ++k) simulation.next(correction, most_packets, result);
  return result;
}

}  // namespace holdfast::testing
