#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "tools/mode_check.h"
#include "tools/text_table.h"

namespace holdfast {
namespace {

// Below this a mean log likelihood ratio per step tells nothing within thousands of steps.
constexpr double kNothing = 1e-4;

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

std::string zero_text(std::complex<double> zero) {
  if (std::abs(zero.imag()) <= 1e-9 * std::max(1.0, std::abs(zero))) return number(zero.real());
  return number(zero.real()) + (zero.imag() < 0.0 ? " - " : " + ") + number(std::abs(zero.imag())) +
         "i";
}

std::string zeros_text(const std::vector<std::complex<double>>& zeros) {
  std::string text;
  for (const auto& zero : zeros) text += (text.empty() ? "" : ", ") + zero_text(zero);
  return text.empty() ? "none" : text;
}

std::string names_of(const ModeCheck& check, const std::vector<int>& channels,
                     const char* last = " and ") {
  const std::vector<std::string>& names = check.modes.topologies.front().attack_names;
  std::string text;
  for (std::size_t i = 0; i < channels.size(); ++i) {
    if (i > 0) text += i + 1 == channels.size() ? last : ", ";
    text += names[static_cast<std::size_t>(channels[i])];
  }
  return text.empty() ? "nothing" : text;
}

std::string in_topology(const ModeCheck& check, const std::string& topology) {
  return check.modes.topologies.size() > 1 ? " (topology " + topology + ")" : "";
}

std::string bad_text(const ModeCheck& check, const BadSet& bad) {
  if (bad.channels.empty()) {
    return "the plant" + in_topology(check, bad.topology) +
           " cannot be followed even while nothing is attacked: zero at " +
           zero_text(bad.theory.zeros.empty() ? 0.0 : bad.theory.zeros.front());
  }
  const std::string names = names_of(check, bad.channels);
  const std::string can =
      bad.channels.size() == 1 ? " cannot be attacked" : " cannot be attacked together";
  const std::string where = in_topology(check, bad.topology) + ": ";
  if (!bad.theory.is_invertible) return names + can + where + "some attack is never seen at all";
  if (!bad.theory.is_strongly_detectable()) {
    const auto zero = bad.theory.zeros.front();
    const bool is_outside = std::abs(zero) > 1.0 + 1e-9;
    return names + can + where + "zero at " + zero_text(zero) + (is_outside ? " outside" : " on") +
           " the unit circle";
  }
  return names + where +
         "no filter with a delay of one step: the readings of two steps do not "
         "determine " +
         names_of(check, [&] {
           std::vector<int> channels;
           for (const int i : bad.theory.undetermined_inputs)
             channels.push_back(bad.channels[static_cast<std::size_t>(i)]);
           return channels;
         }());
}

std::string delay_text(const ModeDivergence& divergence) {
  const int delay = divergence.delay_steps();
  if (delay >= 0) return std::to_string(delay);
  // It may well come after the steps that were looked at.
  return divergence.per_step() > kNothing ? "> " + std::to_string(divergence.log_ratio.size() + 1)
                                          : "never";
}

std::string divergence_text(const ModeDivergence& divergence) {
  const double value = divergence.per_step();
  if (std::isnan(value)) return "not known";
  return std::isfinite(value) ? number(value) : "no bound";
}

const char* likelihood_name(InputLikelihood likelihood) {
  switch (likelihood) {
    case InputLikelihood::kPaper:
      return "paper";
    case InputLikelihood::kOrtho:
      return "ortho";
    case InputLikelihood::kFlat:
      return "flat";
    case InputLikelihood::kEvidence:
      break;
  }
  return "evidence";
}

void add_modes(const ModeCheck& check, std::string& text) {
  TextTable table(3);
  table.add({"mode", "topology", "attacked", "invariant zeros", "correctable", "filter"});
  for (std::size_t i = 0; i < check.modes.modes.size(); ++i) {
    const PlantMode& mode = check.modes.modes[i];
    const ModeTheory& theory = check.theory[i];
    table.add({mode.name, check.modes.topology_names[static_cast<std::size_t>(mode.topology)],
               names_of(check, mode.channels, ", "),
               theory.is_invertible ? zeros_text(theory.zeros) : "everywhere",
               theory.is_strongly_detectable() ? "yes" : "NO",
               theory.undetermined_inputs.empty() ? "exists" : "NONE"});
  }
  text += table.text() + "\n";
}

void add_pairs(const ModeCheck& check, std::string& text) {
  if (check.pairs.empty()) {
    text += check.modes.modes.size() > ModeCheck::kComparedMax
                ? "Modes were not compared in pairs: there are more than " +
                      std::to_string(ModeCheck::kComparedMax) + ".\n"
                : "";
    return;
  }
  TextTable table(2);
  table.add(
      {"true mode", "rival", "divergence", "99 to 1 after", "quiet divergence", "quiet after"});
  for (const ModeCheck::Pair& pair : check.pairs) {
    table.add({check.modes.modes[static_cast<std::size_t>(pair.truth)].name,
               check.modes.modes[static_cast<std::size_t>(pair.rival)].name,
               divergence_text(pair.attacked), delay_text(pair.attacked),
               divergence_text(pair.quiet), delay_text(pair.quiet)});
  }
  text +=
      "Modes in pairs: expected log likelihood ratio per step, and steps until it says 99 to 1,\n"
      "with the scenario's attacks from the first step on, and while nothing is attacked "
      "(likelihood: " +
      std::string(likelihood_name(check.likelihood)) + "):\n" + table.text() + "\n";
}

// The rival that readings of a true mode speak for most, if they speak for one at all.
void warn_of_confusion(const ModeCheck& check, int truth, ModeDivergence ModeCheck::Pair::*which,
                       const std::string& when, std::vector<std::string>& warnings) {
  const ModeCheck::Pair* worst = nullptr;
  for (const ModeCheck::Pair& pair : check.pairs) {
    const double value = (pair.*which).per_step();
    if (pair.truth != truth || !(value < -kNothing)) continue;
    if (worst == nullptr || value < (worst->*which).per_step()) worst = &pair;
  }
  if (worst == nullptr) return;
  warnings.push_back(when + ", mode " + check.modes.modes[static_cast<std::size_t>(truth)].name +
                     " is taken for mode " +
                     check.modes.modes[static_cast<std::size_t>(worst->rival)].name + " (" +
                     number(-(worst->*which).per_step()) + " per step)");
}

// Modes that no set of at most attacked_most channels has warned of.
void warn_of_modes(const ModeCheck& check, std::vector<std::string>& warnings) {
  for (std::size_t i = 0; i < check.modes.modes.size(); ++i) {
    const PlantMode& mode = check.modes.modes[i];
    const std::string& topology =
        check.modes.topology_names[static_cast<std::size_t>(mode.topology)];
    const bool is_told = std::ranges::any_of(check.bad_sets, [&](const BadSet& bad) {
      return bad.topology == topology && std::ranges::includes(mode.channels, bad.channels);
    });
    if (is_told || check.theory[i].is_correctable()) continue;
    warnings.push_back("mode " + mode.name + ": " +
                       bad_text(check, {topology, mode.channels, check.theory[i]}));
  }
  const bool differ = std::ranges::any_of(check.modes.modes, [&](const PlantMode& mode) {
    return mode.channels.size() != check.modes.modes.front().channels.size();
  });
  if (differ && check.likelihood != InputLikelihood::kEvidence) {
    warnings.push_back(
        "modes with different numbers of attacked channels were compared by the likelihood '" +
        std::string(likelihood_name(check.likelihood)) +
        "', which depends on the units of the readings: use evidence");
  }
}

}  // namespace

std::vector<std::string> warnings_of(const ModeCheck& check) {
  std::vector<std::string> warnings;
  for (const BadSet& bad : check.bad_sets) warnings.push_back(bad_text(check, bad));
  warn_of_modes(check, warnings);
  if (check.attacked_most >= check.num_sensors && check.modes.modes.size() > 1) {
    warnings.push_back(
        "as many signals may be attacked as there are readings: nothing is left to "
        "choose between modes by");
  }
  for (const ModeCheck::Pair& pair : check.pairs) {
    const std::string names =
        "modes " + check.modes.modes[static_cast<std::size_t>(pair.truth)].name + " and " +
        check.modes.modes[static_cast<std::size_t>(pair.rival)].name;
    const bool is_first = pair.truth < pair.rival;
    if (is_first && (std::isnan(pair.quiet.per_step()) || std::isnan(pair.attacked.per_step()))) {
      warnings.push_back(names + " were not compared: the numbers overflow");
    }
    if (!pair.is_distinguishable && is_first) {
      warnings.push_back(names +
                         " cannot always be told apart: some attack in the one looks like "
                         "one in the other for ever, and the states differ");
    }
    if (is_first && std::abs(pair.quiet.per_step()) < kNothing) {
      warnings.push_back(
          names + " are alike while nothing is attacked: their probabilities drift at random");
    }
  }
  for (int truth = 0; truth < static_cast<int>(check.modes.modes.size()); ++truth) {
    warn_of_confusion(check, truth, &ModeCheck::Pair::quiet, "while nothing is attacked", warnings);
    warn_of_confusion(check, truth, &ModeCheck::Pair::attacked, "under the scenario's attacks",
                      warnings);
  }
  return warnings;
}

std::string to_text(const ModeCheck& check) {
  const SystemModel& model = check.modes.topologies.front();
  std::string text = std::to_string(model.num_states()) + " states, " +
                     std::to_string(check.num_sensors) + " readings, " +
                     std::to_string(check.num_channels) + " attack channels, " +
                     std::to_string(check.modes.topologies.size()) + " topologies, " +
                     std::to_string(check.modes.modes.size()) + " modes\n\n";
  add_modes(check, text);
  if (check.correctable_most < 0) {
    text += "Too many sets of channels to look at all of them: use a smaller --attacked-most.\n";
  } else {
    text += "Any " + std::to_string(check.correctable_most) + " of the " +
            std::to_string(check.num_channels) +
            " channels at a time are correctable, if the mode is known" +
            (check.is_cut ? "; larger sets are too many to look at.\n" : ".\n");
  }
  text += "Models needed for any " + std::to_string(check.attacked_most) +
          " channels attacked at most, in each topology: " + number(check.models_needed) +
          "; the scenario has " + std::to_string(check.modes.modes.size()) + ".\n";
  if (!check.protecting.empty()) {
    text += "To protect " + names_of(check, check.protecting, " or ") + " alone makes any " +
            std::to_string(check.attacked_most) + " of the rest correctable.\n";
  }
  text += "\n";
  add_pairs(check, text);
  for (const std::string& note : check.notes) text += "note: " + note + "\n";
  const std::vector<std::string> warnings = warnings_of(check);
  for (const std::string& warning : warnings) text += "warning: " + warning + "\n";
  if (warnings.empty()) text += "No warning.\n";
  return text;
}

std::string to_json(const ModeCheck& check) {
  using Json = nlohmann::json;
  const auto zeros_of = [](const ModeTheory& theory) {
    Json zeros = Json::array();
    for (const auto& zero : theory.zeros) zeros.push_back({zero.real(), zero.imag()});
    return zeros;
  };
  const std::vector<std::string>& names = check.modes.topologies.front().attack_names;
  const auto names_json = [&names](const std::vector<int>& channels) {
    Json list = Json::array();
    for (const int channel : channels) list.push_back(names[static_cast<std::size_t>(channel)]);
    return list;
  };
  // JSON has no infinity: null stands for what has no bound.
  const auto finite = [](double value) { return std::isfinite(value) ? Json(value) : Json(); };
  Json json;
  for (std::size_t i = 0; i < check.modes.modes.size(); ++i) {
    const ModeTheory& theory = check.theory[i];
    json["modes"].push_back({{"name", check.modes.modes[i].name},
                             {"channels", names_json(check.modes.modes[i].channels)},
                             {"zeros", zeros_of(theory)},
                             {"is_invertible", theory.is_invertible},
                             {"is_strongly_detectable", theory.is_strongly_detectable()},
                             {"filter_exists", theory.undetermined_inputs.empty()}});
  }
  json["correctable_most"] = check.correctable_most;
  json["correctable_most_is_cut"] = check.is_cut;
  json["attacked_most"] = check.attacked_most;
  json["models_needed"] = check.models_needed;
  json["protecting"] = names_json(check.protecting);
  json["bad_sets"] = Json::array();
  for (const BadSet& bad : check.bad_sets) {
    json["bad_sets"].push_back({{"topology", bad.topology},
                                {"channels", names_json(bad.channels)},
                                {"zeros", zeros_of(bad.theory)}});
  }
  json["pairs"] = Json::array();
  for (const ModeCheck::Pair& pair : check.pairs) {
    json["pairs"].push_back(
        {{"truth", check.modes.modes[static_cast<std::size_t>(pair.truth)].name},
         {"rival", check.modes.modes[static_cast<std::size_t>(pair.rival)].name},
         {"is_distinguishable", pair.is_distinguishable},
         {"divergence_per_step", finite(pair.attacked.per_step())},
         {"delay_steps", pair.attacked.delay_steps()},
         {"quiet_divergence_per_step", finite(pair.quiet.per_step())},
         {"quiet_delay_steps", pair.quiet.delay_steps()}});
  }
  json["notes"] = check.notes;
  json["warnings"] = warnings_of(check);
  return json.dump(2) + "\n";
}

}  // namespace holdfast
