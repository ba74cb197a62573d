#include <cmath>
#include <fstream>

#include "tests/support/catch.h"
#include "tests/support/temporary_folder.h"
#include "tools/reproduce/reproduction.h"

namespace holdfast {
namespace {

const std::string kPapers = std::string(HOLDFAST_SOURCE_DIR) + "/scenarios/papers/";

std::string problem_of(const std::string& text) {
  const testing::TemporaryFolder folder;
  std::ofstream(folder.file("paper.yaml")) << text;
  try {
    load_paper(folder.file("paper.yaml"));
  } catch (const UsageError& error) {
    return error.what();
  }
  return "none";
}

// A paper with one tiny campaign, whose reference is what the test says.
Paper tiny_paper(double reference, double standard_error, bool is_control) {
  Paper paper;
  paper.name = "tiny";
  paper.chosen_by_us = "everything";
  PaperCampaign campaign;
  campaign.name = "only";
  campaign.scenario = std::string(HOLDFAST_SOURCE_DIR) + "/scenarios/binary_tracking.yaml";
  campaign.settings = {
      "steps=10", "estimators=[{name: secure, method: secure_particle_filter, particles: 50}]"};
  campaign.runs = 10;
  campaign.runs_max = 40;
  campaign.quick_runs = 6;
  paper.campaigns = {campaign};
  PaperRow row;
  row.campaign = "only";
  row.estimator = "secure";
  row.group = "position";
  row.reference = reference;
  row.standard_error = standard_error;
  row.is_control = is_control;
  paper.tables = {{"table", "Table", "everything", {row}}};
  return paper;
}

Reproduction reproduce_of(const Paper& paper, bool is_quick) {
  const testing::TemporaryFolder folder;
  ReproductionOptions options;
  options.folder = folder.file("out");
  options.is_quick = is_quick;
  options.num_threads = 1;
  return reproduce(paper, options);
}

Reproduction reproduce_tiny(double reference, double standard_error, bool is_control,
                            bool is_quick) {
  return reproduce_of(tiny_paper(reference, standard_error, is_control), is_quick);
}

Verdict compare_by_tenth(const Uncertain& ours, const Uncertain& reference) {
  return compare(ours, reference, widest_band(reference));
}

}  // namespace

TEST_CASE("a verdict needs both: near enough, and errors small enough to mean it") {
  // band = 4 sqrt(0.3^2 + 0.4^2) = 2
  CHECK(verdict_band({0.0, 0.3}, {0.0, 0.4}) == Approx(2.0).epsilon(1e-15));
  CHECK(compare_by_tenth({101.9, 0.3}, {100.0, 0.4}) == Verdict::kAgrees);
  CHECK(compare_by_tenth({98.1, 0.3}, {100.0, 0.4}) == Verdict::kAgrees);
  CHECK(compare_by_tenth({102.1, 0.3}, {100.0, 0.4}) == Verdict::kDiffers);
  CHECK(compare_by_tenth({97.9, 0.3}, {100.0, 0.4}) == Verdict::kDiffers);
  // A band of 2 is a tenth of 20: it could hide what it should find.
  CHECK(compare_by_tenth({20.0, 0.3}, {20.0, 0.4}) == Verdict::kCannotTell);
  CHECK(compare_by_tenth({20.1, 0.3}, {20.1, 0.4}) == Verdict::kAgrees);
  CHECK(compare_by_tenth({-20.1, 0.3}, {-20.1, 0.4}) == Verdict::kAgrees);
  CHECK(compare_by_tenth({5.0, 0.3}, {1.0, 0.4}) == Verdict::kDiffers);  // far apart, however wide
  CHECK(compare_by_tenth({1.0, std::nan("")}, {1.0, 0.0}) == Verdict::kCannotTell);
  CHECK(compare_by_tenth({std::nan(""), 0.1}, {1.0, 0.0}) == Verdict::kCannotTell);
  // A share near 0 is told by an absolute band.
  CHECK(compare_by_tenth({0.001, 0.0002}, {0.001, 0.0003}) == Verdict::kCannotTell);
  CHECK(compare({0.001, 0.0002}, {0.001, 0.0003}, 0.002) == Verdict::kAgrees);
  CHECK(compare({0.004, 0.0002}, {0.001, 0.0003}, 0.002) == Verdict::kDiffers);
  CHECK(is_reference_too_wide({20.0, 0.451},
                              widest_band({20.0, 0.0})));  // 4 x 0.451 is more than 9 % of 20
  CHECK_FALSE(is_reference_too_wide({20.0, 0.449}, widest_band({20.0, 0.0})));
  CHECK(verdict_text(Verdict::kAgrees, true) == "consistent with");
  CHECK(verdict_text(Verdict::kAgrees, false) == "reproduced");
}

TEST_CASE("a reproduction fails on a row that differs, and on a control that does not") {
  // The tiny filter's error is some metres: a reference of 1 km cannot be it.
  CHECK(reproduce_tiny(1000.0, 1.0, false, true).has_failed(true));
  CHECK_FALSE(reproduce_tiny(1000.0, 1.0, true, true).has_failed(true));
  const Reproduction found = reproduce_tiny(1000.0, 1.0, false, true);
  const Uncertain ours = found.tables[0].rows[0].ours;
  CHECK(found.tables[0].rows[0].num_runs == 6);
  CHECK(reproduce_tiny(ours.value, 0.01, true, true).has_failed(true));
  // Six runs cannot tell: no failure when quick, a failure else, since more runs could.
  const Reproduction quick = reproduce_tiny(ours.value, 0.01, false, true);
  CHECK(quick.tables[0].rows[0].verdict == Verdict::kCannotTell);
  CHECK_FALSE(quick.has_failed(true));
  CHECK(quick.has_failed(false));
  // A reference whose own error is too large is nobody's failure.
  CHECK_FALSE(reproduce_tiny(ours.value, ours.value, false, true).has_failed(false));
}

TEST_CASE(
    "where only a range is known, a value inside agrees and one outside is held to its nearer "
    "end") {
  const Uncertain ours = reproduce_tiny(1000.0, 1.0, false, true).tables[0].rows[0].ours;
  const auto in_range = [](double lowest, double highest) {
    Paper paper = tiny_paper(PaperRow::kNone, 0.0, false);
    paper.tables[0].rows[0].lowest = lowest;
    paper.tables[0].rows[0].highest = highest;
    paper.tables[0].rows[0].band_max = 1e9;
    return reproduce_of(paper, true).tables[0].rows[0];
  };
  CHECK(in_range(0.5 * ours.value, 2.0 * ours.value).verdict == Verdict::kAgrees);
  const double far = 5.0 * ours.standard_error;  // the band is four
  CHECK(in_range(ours.value + far, 1000.0).verdict == Verdict::kDiffers);
  CHECK(in_range(0.0, ours.value - far).verdict == Verdict::kDiffers);
  CHECK(in_range(0.0, ours.value - 3.0 * ours.standard_error).verdict == Verdict::kAgrees);
  CHECK(in_range(ours.value + far, 1000.0).is_judged);
}

TEST_CASE("runs are added until a row can be told, or there are enough") {
  const double reference = reproduce_tiny(1000.0, 1.0, false, true).tables[0].rows[0].ours.value;
  CHECK(reproduce_tiny(reference, 0.01, false, false).tables[0].rows[0].num_runs == 40);
  // One that is told at once, and one that never can be, stop at the first number.
  CHECK(reproduce_tiny(1000.0, 1.0, false, false).tables[0].rows[0].num_runs == 10);
  CHECK(reproduce_tiny(reference, reference, false, false).tables[0].rows[0].num_runs == 10);
}

TEST_CASE("a row names what it cannot find") {
  Paper paper = tiny_paper(1.0, 0.1, false);
  paper.tables[0].rows[0].estimator = "nobody";
  const testing::TemporaryFolder folder;
  ReproductionOptions options;
  options.folder = folder.file("out");
  options.is_quick = true;
  CHECK_THROWS_WITH(reproduce(paper, options), Catch::Contains("nobody"));
}

TEST_CASE("every paper's file reads, has a row that is wrong on purpose, and names its choices") {
  for (const std::string name : {"binary_pf", "gslr", "hbf", "multiple_model"}) {
    const Paper paper = load_paper(kPapers + name + ".yaml");
    CHECK(paper.name == name);
    bool has_control = false;
    for (const PaperTable& table : paper.tables)
      for (const PaperRow& row : table.rows) has_control = has_control || row.is_control;
    CHECK(has_control);
    for (const PaperCampaign& campaign : paper.campaigns)
      CHECK_NOTHROW(load_campaign_plan(
          campaign.scenario, campaign.settings,
          campaign.sweep_key.empty() ? Sweep{}
                                     : Sweep{{{campaign.sweep_key, campaign.sweep_values}}, {}}));
    const Paper part = only(paper, paper.figures[0].name);
    CHECK(part.campaigns.size() == 1);
    CHECK(part.tables.empty());
    CHECK_THROWS_AS(only(paper, "no such figure"), UsageError);
  }
}

TEST_CASE("a wrong paper's file is refused with every problem") {
  using Catch::Contains;
  const std::string head = "holdfast_paper: 1\nname: x\n";
  CHECK(problem_of(head) == "none");
  CHECK_THAT(problem_of(head + "typo: 1\n"), Contains("typo: unknown key"));
  CHECK_THAT(problem_of(head + "figures: [{name: f, campaign: none, kind: pie}]\n"),
             Contains("none of this paper's campaigns") && Contains("pie"));
  CHECK_THAT(problem_of(head + "campaigns: [{name: c, scenario: s, runs: 4, runs_max: 2}]\n"),
             Contains("runs_max"));
  CHECK_THAT(
      problem_of(head + "campaigns: [{name: c, scenario: s}]\n"
                        "tables: [{name: t, campaign: c, rows: [{estimator: e, group: g}]}]\n"),
      Contains("references"));
  const std::string swept =
      head + "campaigns: [{name: c, scenario: s, sweep: {key: k, values: [1, 2, 3]}}]\n";
  CHECK_THAT(problem_of(swept + "tables: [{name: t, campaign: c, rows: [{estimator: e, group: g, "
                                "point: 4, references: 1, between: [2, 1]}]}]\n"),
             Contains("no '4'") && Contains("in the place of") && Contains("below its first"));
}

TEST_CASE("a row is about every point of its campaign's sweep, or about the one it names") {
  const testing::TemporaryFolder folder;
  std::ofstream(folder.file("paper.yaml"))
      << "holdfast_paper: 1\nname: x\n"
         "campaigns: [{name: c, scenario: s, sweep: {key: k, values: [1, 2, 3], labels: [a, b, "
         "c]}}]\n"
         "tables: [{name: t, campaign: c, rows: [{estimator: e, group: g, between: [1, 2]},"
         " {estimator: e, group: g, point: b, references: 7}]}]\n";
  const std::vector<PaperRow> rows = load_paper(folder.file("paper.yaml")).tables[0].rows;
  REQUIRE(rows.size() == 4);
  for (std::int64_t point = 0; point < 3; ++point) {
    const PaperRow& row = rows[static_cast<std::size_t>(point)];
    CHECK(row.point == point);
    CHECK(row.lowest == 1.0);
    CHECK(row.highest == 2.0);
    CHECK(std::isnan(row.reference));
  }
  CHECK(rows[3].point == 1);
  CHECK(rows[3].reference == 7.0);
  CHECK(std::isnan(rows[3].lowest));
}

}  // namespace holdfast
