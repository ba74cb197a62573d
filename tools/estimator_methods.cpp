#include "tools/estimator_methods.h"

#include <algorithm>
#include <array>

#include "tools/tied_beliefs.h"

namespace holdfast {
namespace {

void read_secure_particle_filter(ConfigurationMap& map, const MethodContext& context,
                                 EstimatorEntry& entry) {
  const BinaryTargetSetup& plant = *context.plant.binary_target();
  SecureParticleFilterMaker maker;
  maker.model = plant.model;
  maker.model.read(map.map("model"));
  if (maker.model.num_sensors() != plant.model.num_sensors()) {
    return map.problem("model", "must have as many sensors as the plant's");
  }
  maker.assumes = read_assumed_attack(map.map("assumes"), plant.options.attack, context);
  maker.options.read(map);
  entry.kernel = maker.options.kernel == "auto" ? particle_kernel_name() : maker.options.kernel;
  entry.make = std::move(maker);
}

struct Method {
  const char* name;
  bool needs_vectors;           // a plant with vector readings, else one with binary sensors
  EstimatorEntry::Input input;  // where the scenario says nothing
  void (*read)(ConfigurationMap&, const MethodContext&, EstimatorEntry&);
};

constexpr std::array kMethods = {
    Method{"secure_particle_filter", false, EstimatorEntry::Input::kReceived,
           read_secure_particle_filter},
};

std::string method_names(bool has_vectors) {
  std::string names;
  for (const Method& method : kMethods) {
    if (method.needs_vectors != has_vectors) continue;
    names += (names.empty() ? "" : ", ") + std::string(method.name);
  }
  return names;
}

}  // namespace

std::unique_ptr<Estimator> SecureParticleFilterMaker::operator()(std::uint64_t seed,
                                                                 std::uint32_t run) const {
  return std::make_unique<SecureParticleFilter>(model, assumes, options, seed, run,
                                                "estimator/particles");
}

void read_method(ConfigurationMap& map, const MethodContext& context, EstimatorEntry& entry) {
  const bool has_vectors = context.plant.has_vector_readings();
  entry.method = has_vectors ? "hybrid_bernoulli" : "secure_particle_filter";
  map.read("method", entry.method);
  const auto method = std::find_if(kMethods.begin(), kMethods.end(), [&](const Method& candidate) {
    return candidate.name == entry.method && candidate.needs_vectors == has_vectors;
  });
  if (method == kMethods.end()) {
    return map.problem("method", "'" + entry.method + "' is none of those for this plant: " +
                                     method_names(has_vectors));
  }
  entry.input = method->input;
  map.read_choice("input", entry.input,
                  {{"received", EstimatorEntry::Input::kReceived},
                   {"clean", EstimatorEntry::Input::kClean},
                   {"authentic", EstimatorEntry::Input::kAuthentic}});
  method->read(map, context, entry);
}

}  // namespace holdfast
