// Whole steps of the secure particle filter: draws, likelihood, estimate, resampling; 16 sensors on
// the radio channel, double precision, one thread. Names: kernel/likelihood[/posteriors]/M.

#include <benchmark/benchmark.h>

#include <string>
#include <vector>

#include "estimators/secure_particle_filter.h"

namespace {

using namespace holdfast;

BinaryTargetModel grid_model() {
  BinaryTargetModel model;
  model.has_radio_channel = true;
  for (const double x : {10.0, 30.0, 50.0, 70.0}) {
    for (const double y : {10.0, 30.0, 50.0, 70.0}) model.sensor_positions_m.push_back({x, y});
  }
  return model;
}

BinaryTargetModel::Attack table_attack() {
  BinaryTargetModel::Attack attack;
  attack.dos.assign(16, 0.1);
  attack.deception = attack.flip = attack.dos;
  return attack;
}

// Readings of a target that rests among the sensors, so that a run may be as long as it likes.
std::vector<MeasurementSet> make_readings(const BinaryTargetModel& model) {
  const RandomStream stream(1, 0, "bench/readings");
  std::vector<MeasurementSet> sets(64);
  for (std::size_t k = 0; k < sets.size(); ++k) {
    const auto step = static_cast<std::uint32_t>(k);
    for (std::size_t s = 0; s < 16; ++s) {
      const bool is_near = model.energy({24.0, 0.0, 26.0, 0.0}, s) > model.threshold;
      const bool bit = is_near != (stream.uniform(step, s) < 0.2);
      const double y =
          (bit ? model.radio_gain : 0.0) + model.radio_noise_std * stream.normal(step, 100 + s);
      Packet packet;
      packet.source = static_cast<int>(s);
      sets[k].add(packet, std::span<const double>(&y, 1));
    }
  }
  return sets;
}

void run_steps(benchmark::State& state, const SecureParticleFilterOptions& options, bool neglects) {
  const BinaryTargetModel model = grid_model();
  const auto readings = make_readings(model);
  SecureParticleFilter filter(model, neglects ? BinaryTargetModel::Attack{} : table_attack(),
                              options, 1, 0, "bench/particles");
  const Eigen::VectorXd no_input;
  std::int64_t step = 0;
  for (auto _ : state) {
    ++step;
    const auto& set = readings[static_cast<std::size_t>(step) % readings.size()];
    benchmark::DoNotOptimize(filter.step(step, set, no_input).mean.data());
  }
}

void add(const std::string& name, const SecureParticleFilterOptions& options, bool neglects) {
  benchmark::RegisterBenchmark((name + "/" + std::to_string(options.particles)).c_str(), run_steps,
                               options, neglects)
      ->Unit(benchmark::kMicrosecond);
}

}  // namespace

int main(int argc, char** argv) {
  for (const ParticleKernel* kernel : particle_kernels()) {
    SecureParticleFilterOptions options;
    options.kernel = kernel->name;
    for (const int particles : {200, 400, 600, 10000}) {
      options.particles = particles;
      for (const bool has_posteriors : {false, true}) {
        options.packet_posteriors = has_posteriors;
        const std::string end = has_posteriors ? "/posteriors" : "";
        options.likelihood = SecureParticleFilterOptions::Likelihood::kExact;
        add(std::string(kernel->name) + "/exact" + end, options, false);
        options.likelihood = SecureParticleFilterOptions::Likelihood::kTable;
        add(std::string(kernel->name) + "/table" + end, options, false);
      }
    }
    options.particles = 600;
    options.packet_posteriors = false;
    options.likelihood = SecureParticleFilterOptions::Likelihood::kExact;
    add(std::string(kernel->name) + "/neglecting", options, true);
  }
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
