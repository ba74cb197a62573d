#pragma once

#include <cmath>
#include <limits>
#include <string>

#include "tools/report/figure.h"

namespace holdfast::testing {

// What a hostile log may call things.
inline const std::string kHostile =
    "</script><script>alert(1)</script><img src=x onerror=alert(2)>";

inline Figure state_figure() {
  Figure figure{"state_speed", "Speed of the vehicle and its estimate", "time [s]", "speed [m/s]"};
  FigureSeries truth{"truth", {}, {}, {}, {}};
  FigureSeries estimate{"kalman filter (band: 3 sigma)", {}, {}, {}, {}};
  FigureSeries readings{"wheel sensor", {}, {}, {}, {}, FigureSeries::Style::kPoints};
  for (int k = 0; k < 400; ++k) {
    const double t = 0.05 * k, speed = 3.0 + 2.0 * std::sin(0.6 * t);
    const double error = 0.12 * std::sin(7.3 * t) + (t > 8.0 && t < 12.0 ? 0.7 : 0.0);
    const bool is_lost = k >= 260 && k < 280;
    truth.x.push_back(t);
    truth.y.push_back(speed);
    estimate.x.push_back(t);
    estimate.y.push_back(is_lost ? std::nan("") : speed + error);
    const double sigma = 0.15 + 0.4 * std::exp(-t);
    estimate.low.push_back(is_lost ? std::nan("") : speed + error - 3.0 * sigma);
    estimate.high.push_back(is_lost ? std::nan("") : speed + error + 3.0 * sigma);
    if (k % 4 == 0) {
      readings.x.push_back(t + 0.013);
      readings.y.push_back(speed + 0.3 * std::sin(91.0 * t));
    }
  }
  truth.is_dashed = true;
  figure.series = {truth, estimate, readings};
  figure.spans = {{8.0, 12.0, "attack: bias on the wheel"},
                  {15.0, 15.6, "bus silent"},
                  {17.0, 17.4, "bus silent"}};
  figure.note = "The band is three standard deviations wide on each side.";
  return figure;
}

inline Figure probability_figure() {
  Figure figure{"attack_probability", "Probability of an attack", "time [s]", "probability [-]"};
  FigureSeries probability{"attacked", {}, {}, {}, {}, FigureSeries::Style::kSteps};
  FigureSeries mode{"mode: coasting", {}, {}, {}, {}, FigureSeries::Style::kSteps};
  for (int k = 0; k < 100; ++k) {
    const double t = 0.2 * k;
    probability.x.push_back(t);
    probability.y.push_back(t > 8.2 && t < 12.4 ? 0.97 : 0.04);
    mode.x.push_back(t);
    mode.y.push_back(std::fmod(t, 5.0) < 2.0 ? 0.8 : 0.2);
  }
  figure.series = {probability, mode};
  figure.levels = {{0.5, "decision"}, {0.9, "alarm"}};
  figure.spans = {{8.0, 12.0, "attack: bias on the wheel"}};
  return figure;
}

inline Figure long_figure() {
  Figure figure{"innovation", "Innovation over a long run (200 000 points)", "time of run [s]",
                "innovation [m/s]"};
  FigureSeries series{"wheel sensor", {}, {}, {}, {}};
  for (int k = 0; k < 200'000; ++k) {
    series.x.push_back(0.01 * k);
    series.y.push_back(std::sin(0.002 * k) * std::sin(12.9898 * k) + (k == 123'456 ? 5.0 : 0.0));
  }
  figure.series = {series};
  figure.levels = {{3.0, "threshold"}, {-3.0, "threshold (below)"}};
  return figure;
}

inline Figure logarithmic_figure() {
  Figure figure{"rmse", "Error over the attack probability", "flip probability [-]", "RMSE [m]"};
  for (int e = 0; e < 3; ++e) {
    FigureSeries series{e == 0   ? "secure filter"
                        : e == 1 ? "plain filter"
                                 : "bound",
                        {},
                        {},
                        {},
                        {}};
    for (int i = 0; i <= 10; ++i) {
      const double p = 0.05 * i, value = 0.02 * std::exp((4.0 * e + 3.0) * p);
      series.x.push_back(p);
      series.y.push_back(value);
      if (e == 2) continue;
      series.low.push_back(0.8 * value);
      series.high.push_back(1.25 * value);
    }
    series.is_dashed = e == 2;
    figure.series.push_back(series);
  }
  figure.has_log_y = true;
  figure.note = "Bands: 95 % confidence over 1000 runs.";
  return figure;
}

inline Figure map_figure() {
  Figure figure{"path", "Path in the plane", "east [m]", "north [m]"};
  FigureSeries truth{"truth", {}, {}, {}, {}}, estimate = {"estimate", {}, {}, {}, {}};
  for (int k = 0; k <= 300; ++k) {
    const double angle = 2.0 * std::acos(-1.0) * k / 300.0;
    truth.x.push_back(100.0 * std::cos(angle));
    truth.y.push_back(40.0 * std::sin(angle));
    estimate.x.push_back(103.0 * std::cos(angle) + 2.0);
    estimate.y.push_back(41.0 * std::sin(angle) - 1.0);
  }
  FigureSeries sensors{"sensors", {-80, 0, 80}, {-20, 35, -20},
                       {},        {},           FigureSeries::Style::kPoints};
  truth.is_dashed = true;
  figure.series = {truth, estimate, sensors};
  figure.has_equal_axes = true;
  return figure;
}

inline Figure hostile_figure() {
  Figure figure{"../" + kHostile, "Title " + kHostile, "time [s]", "label " + kHostile};
  figure.series = {{"series " + kHostile, {0.0, 10.0, 20.0}, {1.0, 2.0, 1.5}, {}, {}}};
  figure.levels = {{1.2, "level " + kHostile}};
  figure.spans = {{3.0, 6.0, "span " + kHostile}};
  figure.note = "note " + kHostile;
  return figure;
}

inline Figure empty_figure() {
  Figure figure{"empty", "Nothing was measured", "time [s]", "speed [m/s]"};
  const double nan = std::nan(""), infinity = std::numeric_limits<double>::infinity();
  figure.series = {{"silent", {0.0, 1.0, 2.0}, {nan, infinity, nan}, {}, {}}};
  return figure;
}

/// Every kind of figure, and names that try to leave their places.
inline Report demo_report() {
  Report report{
      "Demonstration of all figures", "seed 1, 400 steps\nfrom no log at all", {}, {}, {}};
  report.warnings = {"One packet was lost.", "warning " + kHostile};
  report.tables = {
      {"Estimators",
       {"estimator", "RMSE [m/s]", "NEES [-]", "lost tracks"},
       {{"kalman filter", "0.123 ± 0.004", "2.01", "0"}, {"cell " + kHostile, "1.5", "-", "12"}},
       "Means over steps."}};
  report.figures = {state_figure(), probability_figure(), long_figure(), logarithmic_figure(),
                    map_figure(),   hostile_figure(),     empty_figure()};
  return report;
}

}  // namespace holdfast::testing
