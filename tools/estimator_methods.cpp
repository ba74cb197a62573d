#include "tools/estimator_methods.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <numeric>

#include "estimators/attack_mixture.h"
#include "estimators/gslr.h"
#include "estimators/hybrid_bernoulli_filter.h"
#include "estimators/interacting_multiple_model.h"
#include "estimators/joint_input_state.h"
#include "estimators/kalman_filter.h"
#include "estimators/multiple_model.h"
#include "estimators/probabilistic_data_association.h"
#include "tools/bounds/attack_oracle.h"
#include "tools/bounds/clairvoyant_filter.h"
#include "tools/bounds/mode_oracle.h"
#include "tools/tied_beliefs.h"

namespace holdfast {
namespace {

// Names what Eigen was built for: other instructions round differently.
std::string linear_algebra_kernel() {
  std::string name = "eigen-";
  for (const char c : std::string(Eigen::SimdInstructionSetsInUse())) {
    if (std::isalnum(static_cast<unsigned char>(c)) != 0) name += c;
    if (c == ',') name += '+';
  }
  return name;
}

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

// What follows serves every method for plants with vector readings: the plant's model, read over.
SystemSource read_belief(ConfigurationMap& map, const MethodContext& context) {
  const SystemSetup& plant = *context.plant.system();
  SystemSource belief = plant.source;
  belief.read(map.map("model"));
  if (belief.model.num_states() != plant.model().num_states() ||
      belief.model.num_measurements() != plant.model().num_measurements()) {
    map.problem("model", "must have as many states and measurements as the plant's");
  }
  return belief;
}

SystemModel read_believed_model(ConfigurationMap& map, const MethodContext& context) {
  return read_belief(map, context).model;
}

// Makes a filter whose constructor takes model, options and the rows of each source.
template <class Filter, class Options>
void set_maker(const MethodContext& context, SystemModel model, Options options,
               EstimatorEntry& entry) {
  entry.kernel = linear_algebra_kernel();
  entry.make = [model = std::move(model), options = std::move(options),
                rows = context.plant.system()->rows](std::uint64_t seed, std::uint32_t run) {
    Options of_run = options;
    if constexpr (requires { of_run.start_is_drawn; }) {
      of_run.start = options.start_of_run(model.num_states(), seed, run);
    }
    return std::make_unique<Filter>(model, of_run, rows);
  };
}

// Attack probabilities that an estimator may be told to share with the bus's rules.
template <class Options>
void tie(ConfigurationMap& map, const MethodContext& context, Options& options) {
  using Action = AttackRule::Action;
  if (const auto delivered =
          tied_probability(map, "delivery_probability", Action::kDrop, false, context)) {
    if (*delivered == 0.0) {
      map.problem("delivery_probability", "cannot be the same: the rules let nothing arrive");
    }
    options.delivery_probability = *delivered;
  }
  if constexpr (requires { options.substitution_probability; }) {
    const auto substituted =
        tied_probability(map, "substitution_probability", Action::kSubstitute, true, context);
    options.substitution_probability = substituted.value_or(options.substitution_probability);
  }
}

// Beliefs about attacks that act one inside the other, as the paper's: armed, then forced or not,
// then biased and scaled.
void tie(ConfigurationMap map, const MethodContext& context, AttackAssumptions::Period& period) {
  using Action = AttackRule::Action;
  ConfigurationMap bias = map.map("bias"), scale = map.map("scale");
  const auto tie_one = [&context](ConfigurationMap& at, const char* key, Action action,
                                  double& belief) {
    belief = probability_of_rule(at, key, action, context).value_or(belief);
  };
  tie_one(map, "attack_probability", Action::kArm, period.attack_probability);
  tie_one(map, "dos_probability", Action::kForce, period.dos_probability);
  tie_one(bias, "probability", Action::kAdd, period.bias_probability);
  tie_one(scale, "probability", Action::kScale, period.scale_probability);
}

template <class Filter, class Options>
void read_for_system(ConfigurationMap& map, const MethodContext& context, EstimatorEntry& entry) {
  const SystemModel model = read_believed_model(map, context);
  if (model.num_inputs() > 0) {
    map.problem("method", "'" + entry.method +
                              "' takes no known inputs, and the plant has some: "
                              "multiple_model with one mode is the Kalman filter that does");
  }
  Options options;
  if constexpr (requires { options.delivery_probability; }) tie(map, context, options);
  if constexpr (requires { options.assumes; }) {
    tie(map.map("assumes"), context, options.assumes.periods.front());
  }
  options.read(map, model);
  set_maker<Filter>(context, model, std::move(options), entry);
}

void read_clairvoyant(ConfigurationMap& map, const MethodContext& context, EstimatorEntry& entry) {
  const SystemModel model = read_believed_model(map, context);
  ClairvoyantFilterOptions options;
  options.start.read(map.map("start"), model.num_states());
  options.attack_prior.read(map.map("attack_prior"), model.num_attack_channels());
  map.read_choice("feedthrough", options.feedthrough,
                  {{"auto", Feedthrough::kAuto},
                   {"direct", Feedthrough::kDirect},
                   {"delayed", Feedthrough::kDelayed}});
  if (entry.input != EstimatorEntry::Input::kAuthentic) {
    map.problem("input", "must be authentic: this filter knows the truth");
  }
  set_maker<ClairvoyantFilter>(context, model, std::move(options), entry);
}

void read_attack_oracle(ConfigurationMap& map, const MethodContext& context,
                        EstimatorEntry& entry) {
  read_for_system<AttackOracle, AttackOracleOptions>(map, context, entry);
  if (entry.input != EstimatorEntry::Input::kTold) {
    map.problem("input", "must be told: this filter knows the truth");
  }
}

// Filters that believe in modes; the plant's, unless they name their own.
template <class Filter, class Options>
void read_for_modes(ConfigurationMap& map, const MethodContext& context, EstimatorEntry& entry) {
  ModeSet modes = read_belief(map, context).modes;
  modes.read(map);
  Options options;
  options.read(map, modes);
  const std::vector<std::vector<int>>& rows = context.plant.system()->rows;
  try {
    const Filter check(modes, options, rows);
  } catch (const UsageError& error) {
    map.problem("method", error.what());
  }
  entry.kernel = linear_algebra_kernel();
  entry.mode_names = modes.names();
  for (const PlantMode& mode : context.plant.system()->source.modes.modes) {
    entry.own_modes.push_back(modes.find(mode.name));
  }
  entry.make = [modes, options, rows](std::uint64_t /*seed*/, std::uint32_t /*run*/) {
    return std::make_unique<Filter>(modes, options, rows);
  };
}

void read_mode_oracle(ConfigurationMap& map, const MethodContext& context, EstimatorEntry& entry) {
  read_for_modes<ModeOracle, ModeOracleOptions>(map, context, entry);
  if (entry.input != EstimatorEntry::Input::kTold) {
    map.problem("input", "must be told: this filter knows the mode");
  }
  std::vector<int> same(context.plant.system()->source.modes.modes.size());
  std::iota(same.begin(), same.end(), 0);
  if (entry.own_modes != same) {
    map.problem("modes", "must be the plant's: the filter is told which of them holds");
  }
}

struct Method {
  const char* name;
  bool needs_vectors;  // a plant with vector readings, else one with binary sensors
  bool can_smooth;
  EstimatorEntry::Input input;  // where the scenario says nothing
  void (*read)(ConfigurationMap&, const MethodContext&, EstimatorEntry&);
};

constexpr std::array kMethods = {
    Method{"secure_particle_filter", false, false, EstimatorEntry::Input::kReceived,
           read_secure_particle_filter},
    Method{"hybrid_bernoulli", true, false, EstimatorEntry::Input::kReceived,
           read_for_system<HybridBernoulliFilter, HybridBernoulliOptions>},
    Method{"gslr", true, true, EstimatorEntry::Input::kReceived,
           read_for_system<Gslr, GslrOptions>},
    Method{"attack_mixture", true, true, EstimatorEntry::Input::kReceived,
           read_for_system<AttackMixture, AttackMixtureOptions>},
    Method{"kalman_filter", true, true, EstimatorEntry::Input::kReceived,
           read_for_system<KalmanFilter, KalmanFilterOptions>},
    Method{"probabilistic_data_association", true, false, EstimatorEntry::Input::kReceived,
           read_for_system<ProbabilisticDataAssociation, ProbabilisticDataAssociationOptions>},
    Method{"joint_input_state", true, false, EstimatorEntry::Input::kReceived,
           read_for_system<JointInputState, JointInputStateOptions>},
    Method{"interacting_multiple_model", true, false, EstimatorEntry::Input::kReceived,
           read_for_system<InteractingMultipleModel, InteractingMultipleModelOptions>},
    Method{"multiple_model", true, false, EstimatorEntry::Input::kReceived,
           read_for_modes<MultipleModel, MultipleModelOptions>},
    Method{"mode_oracle", true, false, EstimatorEntry::Input::kTold, read_mode_oracle},
    Method{"attack_oracle", true, true, EstimatorEntry::Input::kTold, read_attack_oracle},
    Method{"clairvoyant", true, false, EstimatorEntry::Input::kAuthentic, read_clairvoyant},
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

int EstimatorEntry::own_mode(int plant_mode) const {
  if (own_modes.empty()) return plant_mode;
  // A plant with one mode says whether it is attacked, not which mode it is in.
  if (own_modes.size() == 1) return own_modes.front();
  const bool is_known = plant_mode >= 0 && plant_mode < static_cast<int>(own_modes.size());
  return is_known ? own_modes[static_cast<std::size_t>(plant_mode)] : -1;
}

std::unique_ptr<Estimator> SecureParticleFilterMaker::operator()(std::uint64_t seed,
                                                                 std::uint32_t run) const {
  return std::make_unique<SecureParticleFilter>(model, assumes, options, seed, run,
                                                "estimator/particles");
}

std::optional<SmoothedStream> fixed_lag_stream(const EstimatorEntry& entry, Estimator& estimator) {
  if (!entry.is_smoothed || entry.lag_steps == 0) return std::nullopt;
  return SmoothedStream(dynamic_cast<SmoothingEstimator&>(estimator),
                        static_cast<std::size_t>(entry.lag_steps));
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
                   {"authentic", EstimatorEntry::Input::kAuthentic},
                   {"told", EstimatorEntry::Input::kTold}});
  if (entry.input == EstimatorEntry::Input::kTold && method->input != entry.input) {
    map.problem("input", "'" + entry.method + "' cannot be told anything");
  }
  method->read(map, context, entry);
  if (!map.has("smoother")) return;
  entry.is_smoothed = true;
  map.map("smoother").read("lag_steps", entry.lag_steps, {0.0, 100000.0});
  if (!method->can_smooth) map.problem("smoother", "'" + entry.method + "' cannot look back");
}

}  // namespace holdfast
