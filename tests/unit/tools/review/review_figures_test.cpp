#include "tools/review_figures.h"

#include <algorithm>
#include <cmath>
#include <holdfast/attack_signal_t.hpp>

#include "tests/support/catch.h"
#include "tests/unit/tools/review/review_logs.h"
#include "tools/report/report_page.h"
#include "tools/review_figure_parts.h"

namespace holdfast {
namespace {

using namespace review_test;

const Figure* find_figure(const std::vector<Figure>& figures, const std::string& name) {
  const auto found = std::ranges::find(figures, name, &Figure::name);
  return found == figures.end() ? nullptr : &*found;
}

const FigureSeries* find_series(const Figure& figure, const std::string& name) {
  const auto found = std::ranges::find(figure.series, name, &FigureSeries::name);
  return found == figure.series.end() ? nullptr : &*found;
}

TEST_CASE("attacked steps are merged into intervals; of very many the longest stay") {
  std::string note;
  const std::vector<FigureSpan> spans = attack_spans({0, 1, 1, 0, 1}, note);
  REQUIRE(spans.size() == 2);
  CHECK(spans[0].from == 1.5);
  CHECK(spans[0].to == 3.5);
  CHECK(spans[1].from == 4.5);
  CHECK(note == "Shaded: attacked steps, 3 of 5.");

  note.clear();
  CHECK(attack_spans({0, 0}, note).empty());
  CHECK(attack_spans({}, note).empty());
  CHECK(note.empty());

  std::vector<double> busy;
  for (int i = 0; i < 300; ++i) busy.insert(busy.end(), {1, i == 250 ? 1.0 : 0.0, 0});
  const std::vector<FigureSpan> most = attack_spans(busy, note);
  CHECK(most.size() == 100);
  CHECK(std::ranges::any_of(most, [](const FigureSpan& s) { return s.to - s.from == 2.0; }));
  CHECK(std::ranges::is_sorted(most, {}, &FigureSpan::from));
  CHECK(note.find("300 intervals") != std::string::npos);
}

// Two estimators, of which one gives everything; a touched and a foreign frame; times and losses.
void write_full_run(LogWriter& log) {
  std::string scenario = kScenario;
  scenario.replace(scenario.find("model: {"), 8, "model: {step_s: 0.5, ");
  write_meta(log, scenario);
  write_frames(log, "CAN_TX", {make_frame(0, 257, {1}), make_frame(1, 258, {2})});
  write_frames(log, "CAN_RX",
               {make_frame(0, 257, {1}), make_frame(1, 99, {9}), make_frame(2, 258, {2})});
  for (std::int64_t k = 1; k <= 4; ++k) {
    write_truth(log, k, {1, 0, 2, 0});
    estimate_t full =
        make_estimate(k, {4, 0, 6, 0}, {4, 0, 0, 0, 0, 1, 0, 0, 0, 0, 9, 0, 0, 0, 0, 1});
    full.attack_probability = 0.25;
    full.mode_probability = {0.5, 0.5};
    full.num_modes = 2;
    full.innovation = {0.5};
    full.num_innovation = 1;
    full.innovation_covariance = {4.0};
    full.num_innovation_covariance = 1;
    log.write_message("EST_SECURE", 0, full);
    if (k != 2) write_estimate(log, "EST_NEGLECT", k, {1, 0, 2, 0});
    timing_t timing{};
    timing.step = k;
    timing.compute_time_ns = 1000 * k;
    log.write_message("TIMING_SECURE", 0, timing);
    measurement_set_t set{};
    set.step = k;
    packet_t packet{};
    packet.rx_index = k - 1;
    set.packets = {packet};
    set.num_packets = 1;
    log.write_message("MEASUREMENT", 0, set);
  }
  attack_frame_t attack = make_attack(attack_frame_t::ALTERED, 1, "flip");
  attack.step = 3;
  attack.original = make_frame(1, 258, {0});
  log.write_message("ATTACK_FRAME", 0, attack);
  write_status(log, "driver", status_t::FINISHED, {{"lcm_lost", 5}});
}

TEST_CASE("figures hold what the log holds") {
  const TemporaryFolder folder;
  {
    LogWriter log(folder.file("log"));
    write_full_run(log);
  }
  const std::vector<Figure> figures = log_figures(read_reviewed_log(folder.file("log")));
  const Figure* x = find_figure(figures, "state_0_x_position");
  REQUIRE(x != nullptr);
  CHECK(x->x_label == "step (1 step = 0.5 s)");
  CHECK(x->y_label == "x position [m]");
  REQUIRE(find_series(*x, "truth") != nullptr);
  const FigureSeries* secure = find_series(*x, "secure");
  REQUIRE(secure != nullptr);
  REQUIRE(secure->high.size() == 4);
  CHECK(secure->high[0] == 4.0 + 3.0 * 2.0);  // 3 sigma of a variance of 4
  CHECK(secure->low[0] == 4.0 - 3.0 * 2.0);
  REQUIRE(x->spans.size() == 1);
  CHECK(x->spans[0].from == 2.5);
  const FigureSeries* neglect = find_series(*x, "neglect");
  REQUIRE(neglect != nullptr);
  CHECK(neglect->low.empty());  // no covariance, no band
  CHECK(std::ranges::count_if(neglect->y, [](double v) { return std::isnan(v); }) == 1);  // a gap

  const Figure* error = find_figure(figures, "error_position");
  REQUIRE(error != nullptr);
  CHECK(find_series(*error, "secure")->y[0] == 5.0);
  const Figure* attack = find_figure(figures, "attack_probability");
  REQUIRE(attack != nullptr);
  CHECK(attack->series.size() == 1);  // neglect gives none
  CHECK(attack->levels.at(0).y == 0.5);
  CHECK(find_figure(figures, "mode_probability_secure")->series.size() == 2);
  const Figure* innovation = find_figure(figures, "innovation_secure_0");
  REQUIRE(innovation != nullptr);
  CHECK(innovation->series.at(1).high.at(0) == 6.0);
  REQUIRE(find_figure(figures, "nis_secure") != nullptr);
  CHECK(find_series(*find_figure(figures, "nis_secure"), "NIS")->y[0] == 0.0625);

  const Figure* frames = find_figure(figures, "frames");
  REQUIRE(frames != nullptr);
  CHECK(find_series(*frames, "altered")->y == std::vector<double>{258});
  CHECK(find_series(*frames, "foreign")->y == std::vector<double>{99});
  const Figure* packets = find_figure(figures, "packets");
  REQUIRE(packets != nullptr);
  CHECK(find_series(*packets, "attacked")->y == std::vector<double>{0, 1, 1, 0});
  CHECK(find_figure(figures, "losses")->series.at(0).y.back() == 5.0);
  const Figure* times = find_figure(figures, "step_times");
  REQUIRE(times != nullptr);
  CHECK(times->levels.at(0).y == 2.0);
  CHECK(find_figure(figures, "step_time_distribution")->series.at(0).y.back() == 1.0);
  CHECK(find_figure(figures, "path")->has_equal_axes);
}

TEST_CASE("what the log does not hold has no figure") {
  const TemporaryFolder folder;
  {
    LogWriter log(folder.file("log"));
    write_meta(log);
    write_truth(log, 1, {1, 0, 2, 0});
    write_estimate(log, "EST_SECURE", 1, {1, 0, 2, 0});
  }
  const std::vector<Figure> figures = log_figures(read_reviewed_log(folder.file("log")));
  for (const char* name : {"attack_probability", "innovation_secure_0", "nis_secure", "frames",
                           "packets", "losses", "step_times"}) {
    INFO(name);
    CHECK(find_figure(figures, name) == nullptr);
  }
  CHECK(find_figure(figures, "state_0_x_position")->spans.empty());
}

TEST_CASE("names are parts of file names only when they are tame") {
  CHECK(figure_name("../X position") == "___x_position");
  CHECK(figure_name(std::string(500, 'a')).size() <= 60);
}

TEST_CASE("text from a log cannot become a part of the page's code") {
  const TemporaryFolder folder;
  const std::string evil = "<script>alert(1)</script>";
  {
    LogWriter log(folder.file("log"));
    std::string scenario = kScenario;
    scenario.replace(scenario.find("name: secure"), 12, "name: \"" + evil + "\"");
    scenario.replace(scenario.find("name: position"), 14, "name: \"" + evil + "\"");
    write_meta(log, scenario);
    for (std::int64_t k = 1; k <= 2; ++k) {
      write_truth(log, k, {1, 0, 2, 0});
      write_estimate(log, "EST__SCRIPT_ALERT_1___SCRIPT_", k, {1, 0, 2, 0});
      write_estimate(log, "EST_" + evil, k, {1, 0, 2, 0});
    }
    attack_frame_t attack = make_attack(attack_frame_t::ALTERED, 1, evil);
    attack.action = evil;
    attack.step = 1;
    log.write_message("ATTACK_FRAME", 0, attack);
    log.write("EST_" + evil, 0, {1});
    write_status(log, evil, status_t::FAILED, {{evil, 3}});
  }
  const Report report = log_report(read_reviewed_log(folder.file("log")));
  const auto is_named = [&](const ReportTable& table) {
    return std::ranges::any_of(
        table.rows, [&](const auto& row) { return std::ranges::find(row, evil) != row.end(); });
  };
  CHECK(std::ranges::count_if(report.tables, is_named) >= 3);  // it did reach the page
  const std::string page = report_page(report);
  CHECK(page.find("alert(1)") != std::string::npos);
  CHECK(page.find(evil) == std::string::npos);
  CHECK(page.find("<script>alert") == std::string::npos);
  CHECK(page.find("</script>alert") == std::string::npos);
}

}  // namespace
}  // namespace holdfast
