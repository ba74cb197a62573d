#include <algorithm>
#include <span>

#include "tools/campaign/campaign_figures.h"
#include "tools/reproduce/reproduction.h"
#include "tools/simulation.h"

namespace holdfast {
namespace {

bool is_wanted(const PaperFigure& figure, const std::string& estimator) {
  return figure.estimators.empty() ||
         std::ranges::find(figure.estimators, estimator) != figure.estimators.end();
}

std::vector<FigureSeries> wanted(const PaperFigure& figure, std::vector<FigureSeries> series) {
  std::erase_if(series,
                [&figure](const FigureSeries& one) { return !is_wanted(figure, one.name); });
  return series;
}

// Points of the independent reference beside the estimator's own.
FigureSeries reference_series(const PaperFigure& figure, const std::string& estimator,
                              const std::vector<double>& x,
                              const std::vector<TableResult>& tables) {
  FigureSeries reference;
  reference.name = estimator + ", reference";
  reference.style = FigureSeries::Style::kPoints;
  for (const TableResult& table : tables) {
    for (const RowResult& row : table.rows) {
      if (row.row.campaign != figure.campaign || row.row.estimator != estimator ||
          row.row.group != figure.group || row.row.metric != figure.metric || !row.is_judged)
        continue;
      reference.x.push_back(x[static_cast<std::size_t>(row.row.point)]);
      reference.y.push_back(row.reference.value);
    }
  }
  return reference;
}

void draw_path(const PaperFigure& figure, const Experiment& experiment, Figure& drawn) {
  const auto group = std::ranges::find(experiment.state_groups, figure.group, &StateGroup::name);
  if (group == experiment.state_groups.end() || group->states.size() < 2)
    throw UsageError("figure " + figure.name + ": its group must have two states");
  const int x = group->states[0], y = group->states[1];
  drawn.has_equal_axes = true;
  Simulation simulation(experiment, static_cast<std::uint32_t>(figure.run));
  FigureSeries truth;
  truth.name = "truth";
  std::vector<FigureSeries> estimates(simulation.entries().size());
  while (simulation.advance()) {
    truth.x.push_back(simulation.truth().state[x]);
    truth.y.push_back(simulation.truth().state[y]);
    for (std::size_t i = 0; i < estimates.size(); ++i) {
      estimates[i].x.push_back(simulation.estimates()[i]->mean[x]);
      estimates[i].y.push_back(simulation.estimates()[i]->mean[y]);
    }
  }
  drawn.series.push_back(std::move(truth));
  for (std::size_t i = 0; i < estimates.size(); ++i) {
    estimates[i].name = simulation.entries()[i]->name;
    estimates[i].is_dashed = true;
    if (is_wanted(figure, estimates[i].name)) drawn.series.push_back(std::move(estimates[i]));
  }
  const BinaryTargetSetup* target = experiment.plant.binary_target();
  if (target == nullptr) return;
  FigureSeries sensors;
  sensors.name = "sensors";
  sensors.style = FigureSeries::Style::kPoints;
  for (const auto& position : target->model.sensor_positions_m) {
    sensors.x.push_back(position[0]);
    sensors.y.push_back(position[1]);
  }
  drawn.series.push_back(std::move(sensors));
}

std::span<const double> span_of(const Eigen::VectorXd& values) {
  return {values.data(), static_cast<std::size_t>(values.size())};
}

// What really was, of what the figure shows; a mode is one or zero.
std::span<const double> true_values(PaperFigure::Kind kind, const Simulation& simulation,
                                    std::vector<double>& modes) {
  const PlantStep& truth = simulation.truth();
  if (kind == PaperFigure::Kind::kStates) return span_of(truth.state);
  if (kind == PaperFigure::Kind::kAttack) return simulation.true_attack();
  std::fill(modes.begin(), modes.end(), 0.0);
  if (truth.mode >= 0 && static_cast<std::size_t>(truth.mode) < modes.size()) {
    modes[static_cast<std::size_t>(truth.mode)] = 1.0;
  }
  return modes;
}

std::span<const double> estimated_values(PaperFigure::Kind kind, const Estimate& estimate) {
  if (kind == PaperFigure::Kind::kStates) return span_of(estimate.mean);
  if (kind == PaperFigure::Kind::kAttack) return span_of(estimate.input_mean);
  return estimate.mode_probability;
}

// Truth and estimates of some states, channels of the attack signal or modes, over one run.
void draw_signals(const PaperFigure& figure, const Experiment& experiment, Figure& drawn) {
  std::vector<double> modes(
      figure.sources.empty()
          ? 0U
          : static_cast<std::size_t>(*std::ranges::max_element(figure.sources)) + 1U);
  Simulation simulation(experiment, static_cast<std::uint32_t>(figure.run));
  const std::size_t num_estimators = simulation.entries().size();
  for (const std::int64_t source : figure.sources) {
    const std::string suffix = figure.sources.size() == 1 ? "" : " " + std::to_string(source + 1);
    drawn.series.emplace_back().name = "truth" + suffix;
    for (const EstimatorEntry* entry : simulation.entries()) {
      drawn.series.emplace_back().name = entry->name + suffix;
      drawn.series.back().is_dashed = true;
    }
  }
  const auto add = [](FigureSeries& series, double x, std::span<const double> values,
                      std::int64_t index) {
    if (index < 0 || static_cast<std::size_t>(index) >= values.size()) return;
    series.x.push_back(x);
    series.y.push_back(values[static_cast<std::size_t>(index)]);
  };
  while (simulation.advance()) {
    const auto step = static_cast<double>(simulation.truth().step);
    std::size_t place = 0;
    for (const std::int64_t source : figure.sources) {
      add(drawn.series[place++], step, true_values(figure.kind, simulation, modes), source);
      for (std::size_t i = 0; i < num_estimators; ++i) {
        const Estimate& estimate = *simulation.estimates()[i];
        const bool is_attack = figure.kind == PaperFigure::Kind::kAttack;
        const double x = is_attack ? static_cast<double>(estimate.input_step) : step;
        add(drawn.series[place++], x, estimated_values(figure.kind, estimate), source);
      }
    }
  }
  std::erase_if(drawn.series, [&](const FigureSeries& series) {
    const bool is_other =
        series.is_dashed && !is_wanted(figure, series.name.substr(0, series.name.find(' ')));
    return series.x.empty() || is_other;
  });
}

void draw_packets(const PaperFigure& figure, const Experiment& experiment, Figure& drawn) {
  Simulation simulation(experiment, static_cast<std::uint32_t>(figure.run));
  FigureSeries all, authentic;
  all.name = "packets";
  authentic.name = "genuine";
  all.style = authentic.style = FigureSeries::Style::kPoints;
  while (simulation.advance()) {
    const auto step = static_cast<double>(simulation.truth().step);
    all.x.push_back(step);
    all.y.push_back(static_cast<double>(simulation.measurements().packets.size()));
    authentic.x.push_back(step);
    authentic.y.push_back(static_cast<double>(simulation.num_authentic()));
  }
  drawn.series = {std::move(all), std::move(authentic)};
}

void draw_readings(const PaperFigure& figure, const Experiment& experiment, Figure& drawn) {
  Simulation simulation(experiment, static_cast<std::uint32_t>(figure.run));
  std::vector<FigureSeries> series(figure.sources.size());
  for (std::size_t i = 0; i < series.size(); ++i) {
    series[i].name = "source " + std::to_string(figure.sources[i]);
    series[i].style = FigureSeries::Style::kPoints;
  }
  for (double step = 1.0; simulation.advance(); ++step) {
    const MeasurementSet& set = simulation.measurements();
    for (const Packet& packet : set.packets) {
      for (std::size_t i = 0; i < series.size(); ++i) {
        if (packet.source != figure.sources[i] || packet.num_values == 0) continue;
        series[i].x.push_back(step);
        series[i].y.push_back(set.values[packet.first_value]);
      }
    }
  }
  drawn.series = std::move(series);
}

}  // namespace

Figure draw(const PaperFigure& figure, const PaperCampaign& campaign, const CampaignPlan& plan,
            const CampaignSummary& summary, const std::vector<TableResult>& tables) {
  Figure drawn;
  drawn.name = figure.name;
  drawn.title = figure.title;
  const bool is_sweep = figure.kind == PaperFigure::Kind::kSweep;
  drawn.x_label = !figure.x_label.empty() ? figure.x_label : is_sweep ? campaign.sweep_key : "step";
  drawn.y_label = figure.y_label;
  const Experiment& experiment = plan.points.front().experiment;
  switch (figure.kind) {
    case PaperFigure::Kind::kCurve:
      drawn.series =
          wanted(figure, curve_series(summary.points.front(), figure.metric, figure.group));
      break;
    case PaperFigure::Kind::kSweep: {
      const std::vector<double> x = axis_of(campaign.sweep_values);
      for (FigureSeries& series :
           wanted(figure, sweep_series(summary, x, figure.metric, figure.group))) {
        const std::string name = series.name;
        drawn.series.push_back(std::move(series));
        FigureSeries reference = reference_series(figure, name, x, tables);
        if (!reference.x.empty()) drawn.series.push_back(std::move(reference));
      }
      break;
    }
    case PaperFigure::Kind::kPath:
      draw_path(figure, experiment, drawn);
      drawn.note = "Run " + std::to_string(figure.run) + " of the campaign.";
      return drawn;
    case PaperFigure::Kind::kStates:
    case PaperFigure::Kind::kAttack:
    case PaperFigure::Kind::kModes:
      draw_signals(figure, experiment, drawn);
      drawn.note = "Run " + std::to_string(figure.run) + " of the campaign.";
      return drawn;
    case PaperFigure::Kind::kPackets:
      draw_packets(figure, experiment, drawn);
      drawn.note = "Run " + std::to_string(figure.run) + " of the campaign.";
      return drawn;
    case PaperFigure::Kind::kReadings:
      draw_readings(figure, experiment, drawn);
      drawn.note = "Run " + std::to_string(figure.run) + " of the campaign.";
      return drawn;
  }
  drawn.note = "Bands: two standard errors to each side, " +
               std::to_string(summary.points.front().num_runs) + " runs.";
  return drawn;
}

}  // namespace holdfast
