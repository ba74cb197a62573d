#include <sys/wait.h>

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "tests/support/catch.h"
#include "tests/unit/tools/review/review_logs.h"

namespace holdfast {
namespace {

using namespace review_test;

struct Outcome {
  int status = -1;
  std::string output, errors;
};

Outcome run_review(const TemporaryFolder& folder, const std::string& arguments) {
  const std::string command = "'" + std::string(HOLDFAST_BINARY_DIR) + "/bin/holdfast-review' " +
                              arguments + " >" + folder.file("stdout") + " 2>" +
                              folder.file("stderr");
  const int status = std::system(command.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read_file(folder.file("stdout")),
          read_file(folder.file("stderr"))};
}

void write_short_run(const std::string& file, double x) {
  LogWriter log(file);
  write_meta(log);
  for (std::int64_t k = 1; k <= 4; ++k) {
    write_truth(log, k, {0, 0, 0, 0});
    write_estimate(log, "EST_SECURE", k, {x, 0, 0, 0});
    write_estimate(log, "EST_NEGLECT", k, {1, 0, 0, 0});
  }
}

TEST_CASE("holdfast-review: exit status and output") {
  const TemporaryFolder folder;
  const std::string a = folder.file("a"), b = folder.file("b");
  write_short_run(a, 3.0);
  write_short_run(b, 3.5);

  const Outcome help = run_review(folder, "--help");
  CHECK(help.status == 0);
  CHECK(help.output.find("--compare live.lcm replay.lcm") != std::string::npos);
  CHECK(run_review(folder, "--version").output.starts_with("holdfast-review "));

  const Outcome two = run_review(folder, a + " " + b);
  CHECK(two.status == 0);
  CHECK(two.errors.empty());
  CHECK(two.output.find("position m") != two.output.rfind("position m"));

  const Outcome json = run_review(
      folder, a + " --json - --out " + folder.file("report") + " --labels " + folder.file("l.csv"));
  CHECK(json.status == 0);
  CHECK(nlohmann::json::parse(json.output)["estimators"][0]["rmse"]["position"]["value"] == 3.0);
  CHECK(std::filesystem::exists(folder.file("report/path.svg")));
  CHECK(std::filesystem::exists(folder.file("l.csv")));
  const auto both = nlohmann::json::parse(run_review(folder, a + " " + b + " --json -").output);
  CHECK(both["logs"].size() == 2);
  CHECK(both["combined"].size() == 1);

  CHECK(run_review(folder, "--compare " + a + " " + a).status == 0);
  const Outcome different = run_review(folder, "--compare " + a + " " + b);
  CHECK(different.status == 1);
  CHECK(different.output.find("EST_SECURE step 1 mean[0]") != std::string::npos);
  CHECK(run_review(folder, "--compare " + a + " " + b + " --channels EST_NEGLECT").status == 0);
}

TEST_CASE("holdfast-review: tables, pages and figures go where they are asked to") {
  const TemporaryFolder folder;
  const std::string a = folder.file("a"), b = folder.file("b");
  write_short_run(a, 3.0);
  write_short_run(b, 3.5);
  const Outcome csv = run_review(folder, a + " --csv " + folder.file("csv"));
  CHECK(csv.status == 0);
  CHECK(csv.errors.empty());
  CHECK(read_file(folder.file("csv/EST_SECURE.csv")).starts_with("log_event,log_utime,utime,"));
  CHECK(run_review(folder, a + " " + b + " --csv " + folder.file("both")).status == 0);
  CHECK(std::filesystem::exists(folder.file("both/2/EST_SECURE.csv")));

  CHECK(run_review(folder, a + " --report " + folder.file("a.html")).status == 0);
  CHECK(read_file(folder.file("a.html")).find("hand_made") != std::string::npos);
  CHECK(run_review(folder, a + " " + b + " --report " + folder.file("both.html")).status == 0);
  CHECK(read_file(folder.file("both.html")).find("Metrics over 2 runs") != std::string::npos);
  CHECK(run_review(folder, a + " --figures " + folder.file("figures")).status == 0);
  CHECK(std::filesystem::exists(folder.file("figures/state_0_x_position.svg")));

  CHECK(run_review(folder, a + " --csv /proc/none").status == 1);
  CHECK(run_review(folder, a + " --report /proc/none.html").status == 1);
}

TEST_CASE("holdfast-review: a run's report does without what draws pages") {
  const TemporaryFolder folder;
  write_short_run(folder.file("a"), 3.0);
  // Without a path there is no gnuplot; a build with the plotting library needs none.
  const std::string command = "PATH=/none '" + std::string(HOLDFAST_BINARY_DIR) +
                              "/bin/holdfast-review' " + folder.file("a") + " --out " +
                              folder.file("report") + " >/dev/null";
  CHECK(std::system(command.c_str()) == 0);
  const bool has_page = std::filesystem::exists(folder.file("report/report.html"));
  const std::string table = read_file(folder.file("report/review.txt"));
  CHECK(has_page == (table.find("no report.html: ") == std::string::npos));
}

TEST_CASE("holdfast-review: wrong use is status 2 and says what to do") {
  const TemporaryFolder folder;
  write_short_run(folder.file("a"), 1.0);
  {
    LogWriter log(folder.file("none"));
    write_truth(log, 1, {0, 0, 0, 0});
  }
  const Outcome none = run_review(folder, folder.file("none"));
  CHECK(none.status == 2);
  CHECK(none.errors.find("holds no RUN_META") != std::string::npos);
  for (const std::string& arguments :
       {std::string(), std::string("--nonsense"), folder.file("absent"),
        "--compare " + folder.file("a"), folder.file("a") + " " + folder.file("a") + " --out x",
        "--compare " + folder.file("a") + " " + folder.file("absent"),
        "--compare " + folder.file("a") + " " + folder.file("a") + " --channels '('",
        folder.file("a") + " --channels x", folder.file("a") + " --figures f --format gif",
        folder.file("a") + " --format png"}) {
    INFO(arguments);
    const Outcome wrong = run_review(folder, arguments);
    CHECK(wrong.status == 2);
    CHECK_FALSE(wrong.errors.empty());
  }
  CHECK(run_review(folder, folder.file("a") + " --out /proc/none").status == 1);
}

}  // namespace
}  // namespace holdfast
