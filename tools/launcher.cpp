#include "tools/launcher.h"

#include <signal.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <functional>
#include <iostream>
#include <optional>

#include "common/clock.h"
#include "common/errors.h"
#include "drivers/event_loop.h"
#include "tools/child_process.h"
#include "tools/experiment.h"
#include "tools/printable_text.h"
#include "tools/review_report.h"
#include "tools/run_members.h"
#include "tools/run_network.h"
#include "tools/run_recorder.h"

namespace holdfast {
namespace {

constexpr double kPollPeriod_s = 0.02;
constexpr double kStopTimeout_s = 5.0;
constexpr double kFlushPeriod_s = 0.1;
constexpr double kStallPeriods = 5.0;
// Our processes tell their step four times a second; a guest is slower.
constexpr double kStatusAllowance_s = 1.0;
// Until the plant's process has started, has found its bus, and its first step has come through.
constexpr double kFirstStepAllowance_s = 10.0;

std::string time_stamp() {
  const std::time_t now = static_cast<std::time_t>(wall_utime() / 1'000'000);
  std::tm parts{};
  gmtime_r(&now, &parts);
  char text[32];
  std::strftime(text, sizeof text, "%Y%m%dT%H%M%SZ", &parts);
  return text;
}

std::string make_run_folder(const std::string& runs_folder, const std::string& name) {
  const std::string base = runs_folder + "/" + name + "-" + time_stamp();
  try {
    std::filesystem::create_directories(runs_folder);
    for (int attempt = 1;; ++attempt) {
      const std::string folder = attempt == 1 ? base : base + "-" + std::to_string(attempt);
      if (std::filesystem::create_directory(folder)) return folder;
    }
  } catch (const std::filesystem::filesystem_error& error) {
    throw JobError("cannot make the run's folder " + base + ": " + error.code().message() +
                   "; name another folder by --runs");
  }
}

// Replaces each {key} of a command; what is put in is not looked at again.
std::string fill_in(const std::string& command,
                    const std::vector<std::pair<std::string, std::string>>& values) {
  std::string text;
  for (std::size_t at = 0; at < command.size();) {
    const auto is_here = [&](const auto& value) {
      return command.compare(at, value.first.size(), value.first) == 0;
    };
    const auto found = std::find_if(values.begin(), values.end(), is_here);
    text += found == values.end() ? command.substr(at, 1) : found->second;
    at += found == values.end() ? 1 : found->first.size();
  }
  return text;
}

class Launcher {
 public:
  explicit Launcher(const LaunchOptions& options)
      : options_(options),
        experiment_(load_experiment(options.scenario, options.overrides)),
        network_(resolve_network(experiment_, options.lcm_url)),
        link_(network_.lcm_url) {}

  int run() {
    for (const std::string& url : {network_.sensor_bus, network_.monitor_bus}) {
      if (url.rfind("udp:", 0) == 0 || url.rfind("socketcan:", 0) == 0) require_quiet_bus(url, 0.1);
    }
    folder_ = make_run_folder(options_.runs_folder, experiment_.name);
    write_text_file(folder_ + "/scenario.yaml", experiment_.resolved);
    log_ = folder_ + "/log.lcm";
    describe();
    adopt_orphans();
    members_.emplace(link_, folder_, experiment_.num_steps);
    loop_.watch(link_.file_descriptor(), [this] { link_.handle_pending(); });
    loop_.on_stop_signal([this] { is_interrupted_ = true; });
    start_recording();
    const bool has_run = start_members() && start_plant() && follow();
    stop_members();
    stop_recording();
    std::cout << report() << std::flush;
    if (is_interrupted_) {
      std::cerr << "holdfast-run: stopped by a signal; the log holds what was recorded until then"
                << std::endl;
      return 130;
    }
    return has_run && failure_.empty() ? 0 : 1;
  }

 private:
  using Role = RunMembers::Role;

  void describe() {
    std::cout << "scenario   " << experiment_.name << " (seed " << experiment_.seed << ", "
              << experiment_.num_steps << " steps)\n";
    if (network_.is_embedded_bus) {
      std::cout << "bus        embedded (UDP on loopback): this kernel has no vcan0 and vcan1\n";
    }
    std::cout << "           sensors " << network_.sensor_bus << ", monitor "
              << network_.monitor_bus << "\n"
              << "run        " << folder_ << "\n";
    for (const EstimatorEntry& entry : experiment_.estimators) {
      if (entry.is_outside())
        std::cout << "outside    " << entry.name << ": " << printable(entry.command) << "\n";
    }
    if (!experiment_.plant.command.empty())
      std::cout << "outside    plant: " << printable(experiment_.plant.command) << "\n";
    describe_way_in();
  }

  // How another terminal gets to see the run.
  void describe_way_in() const {
    const std::string variable = "LCM_DEFAULT_URL='" + network_.lcm_url + "'";
    if (std::getenv("HOLDFAST_VCAN_GUEST") != nullptr) {
      std::cout
          << "look       the run is inside a guest kernel, which no other terminal gets into; "
             "look in from the same command:\n"
          << "           scripts/with-vcan bash -c 'scripts/run SCENARIO & candump vcan1'\n"
          << "lcm        " << variable << std::endl;
      return;
    }
    std::cout << "look       ";
    if (const char* pid = std::getenv("HOLDFAST_NAMESPACE_PID")) {
      std::cout << "nsenter --preserve-credentials -U -n -t " << pid << " -- ";
    }
    std::cout << "env " << variable << " scripts/spy" << std::endl;
  }

  // Turns the loop until the condition holds; false on failure, signal or time-out.
  bool wait_until(const std::function<bool()>& condition, double timeout_s,
                  const std::function<std::string()>& what) {
    const std::int64_t deadline_ns =
        monotonic_time_ns() + static_cast<std::int64_t>(timeout_s * 1e9);
    bool is_met = false;
    while (!(is_met = condition()) && failure_.empty() && !is_interrupted_) {
      if (monotonic_time_ns() > deadline_ns) {
        fail(what());
        break;
      }
      loop_.run_for(kPollPeriod_s);
      const std::string failure = members_->find_failure(has_plant_started_);
      if (!failure.empty()) fail(failure);
    }
    return is_met && failure_.empty() && !is_interrupted_;
  }

  void fail(const std::string& text) {
    if (!failure_.empty()) return;
    failure_ = text;
    std::cerr << "holdfast-run: " << text << std::endl;
  }

  void start_recording() {
    const RunMeta meta{experiment_.name, experiment_.resolved, experiment_.seed, 0,
                       experiment_.kernel_text()};
    recorder_.emplace(link_, log_, meta, [this](const std::string& text) { fail(text); });
    loop_.every(kFlushPeriod_s, [this] { recorder_->flush(); });
    loop_.every(1.0, [this] { recorder_->publish_meta(); });
  }

  void stop_recording() {
    recorder_->publish_last_word();
    spin_until([this] { return recorder_->has_last_word(); }, kStopTimeout_s);
    recorder_->flush();
    const LinkCounters& counters = link_.counters();
    if (counters.kernel_drops > 0) {
      std::cerr << "holdfast-run: the kernel dropped " << counters.kernel_drops
                << " datagrams before they could be recorded" << std::endl;
    }
  }

  std::vector<std::string> command(const std::string& program,
                                   std::vector<std::string> arguments) const {
    std::vector<std::string> argv = {options_.program_folder + "/" + program, "--scenario",
                                     folder_ + "/scenario.yaml", "--lcm-url", network_.lcm_url};
    argv.insert(argv.end(), arguments.begin(), arguments.end());
    return argv;
  }

  std::vector<std::string> outside_command(const std::string& text, const std::string& name) const {
    return {"sh", "-c",
            fill_in(text, {{"{lcm_url}", shell_quoted(network_.lcm_url)},
                           {"{name}", name},
                           {"{scenario}", shell_quoted(folder_ + "/scenario.yaml")},
                           {"{sensor_bus}", shell_quoted(network_.sensor_bus)}})};
  }

  // Arguments of a member that may write to a bus.
  std::vector<std::string> owned(std::vector<std::string> arguments) const {
    for (const std::string& bus : options_.owned_buses)
      arguments.insert(arguments.end(), {"--i-own-this-bus", bus});
    return arguments;
  }

  bool start_members() {
    if (!failure_.empty() || is_interrupted_) return false;
    if (experiment_.has_bus()) {
      members_->start("driver",
                      command("holdfast-can-driver", owned({"--bus", network_.monitor_bus})),
                      Role::kOurs);
      std::vector<std::string> arguments = {"--ignore-losses", "--from", network_.sensor_bus,
                                            "--to", network_.monitor_bus};
      if (!options_.control.empty())
        arguments.insert(arguments.end(), {"--control", options_.control});
      if (options_.is_dry) arguments.emplace_back("--dry-run");
      members_->start("attacker", command("holdfast-attacker", owned(std::move(arguments))),
                      Role::kOurs);
    }
    for (const EstimatorEntry& entry : experiment_.estimators) {
      if (entry.is_outside()) {
        members_->start(entry.name, outside_command(entry.command, entry.name),
                        Role::kOutsideEstimator);
      } else if (entry.is_campaign_only()) {
        std::cout << "left out   " << entry.name << ": sees what only a campaign knows"
                  << std::endl;
      } else {
        members_->start(entry.name, command("holdfast-estimator", {"--name", entry.name}),
                        Role::kOurs);
      }
    }
    return wait_until([this] { return members_->are_ready(); }, options_.ready_timeout_s,
                      [this] { return not_ready_text(); });
  }

  std::string not_ready_text() const {
    return "not ready in time: " + members_->not_ready() + "; see the output files in " + folder_ +
           "; an outside command must publish STATUS_<NAME> with state READY (--ready-timeout "
           "gives it longer)";
  }

  bool start_plant() {
    if (experiment_.plant.command.empty()) {
      members_->start("plant", command("holdfast-plant", owned({"--bus", network_.sensor_bus})),
                      Role::kOurs);
    } else {
      members_->start("plant", outside_command(experiment_.plant.command, "plant"),
                      Role::kOutsidePlant);
    }
    has_plant_started_ = true;
    return true;
  }

  // Waits for the last step everywhere; a run in which no step comes any more is stalled.
  bool follow() {
    const double stall_s =
        std::max(options_.stall_timeout_s, kStallPeriods * experiment_.period_s) +
        kStatusAllowance_s;
    std::int64_t last_sum = members_->sum_of_steps(), last_change_ns = monotonic_time_ns();
    bool has_stepped = false;
    const auto is_over = [&] {
      const std::int64_t sum = members_->sum_of_steps();
      if (sum != last_sum) {
        has_stepped = true;
        last_sum = sum;
        last_change_ns = monotonic_time_ns();
        show_progress(members_->slowest_step());
      }
      const double quiet_s = static_cast<double>(monotonic_time_ns() - last_change_ns) * 1e-9;
      const bool is_done = members_->are_done();
      if (!is_done && quiet_s > stall_s + (has_stepped ? 0.0 : kFirstStepAllowance_s))
        fail(stall_text(quiet_s));
      return is_done;
    };
    return wait_until(is_over, 1e9, [] { return std::string("the run has no end"); });
  }

  std::string stall_text(double quiet_s) const {
    return "no new step for " + std::to_string(std::llround(quiet_s)) +
           " s:" + members_->steps_text() + " a tick was lost, or a process hangs";
  }

  void show_progress(std::int64_t step) const {
    if (!options_.shows_progress) return;
    std::cout << "\rstep " << step << " of " << experiment_.num_steps << std::flush;
    if (step >= experiment_.num_steps) std::cout << "\n";
  }

  void stop_members() {
    const auto are_gone = [this] { return members_->are_gone(); };
    members_->send(SIGTERM);
    spin_until(are_gone, kStopTimeout_s);
    const std::string left_over = members_->left_over();
    if (left_over.empty()) return;
    std::cerr << "holdfast-run: killed, as it did not stop: " << left_over << std::endl;
    members_->send(SIGKILL);
    spin_until(are_gone, kStopTimeout_s);
  }

  void spin_until(const std::function<bool()>& condition, double timeout_s) {
    const std::int64_t deadline_ns =
        monotonic_time_ns() + static_cast<std::int64_t>(timeout_s * 1e9);
    while (!condition() && monotonic_time_ns() < deadline_ns) loop_.run_for(kPollPeriod_s);
  }

  std::string report() {
    try {
      return "\n" + write_review_report(log_, folder_) + "\nlog        " + log_ + "\nreport     " +
             folder_ + "/report.html (also review.txt, review.json)\npath       " + folder_ +
             "/path.svg\n";
    } catch (const std::exception& error) {
      fail(std::string("the log cannot be reviewed: ") + error.what());
      return "";
    }
  }

  LaunchOptions options_;
  Experiment experiment_;
  RunNetwork network_;
  LcmLink link_;
  EventLoop loop_;
  std::string folder_, log_, failure_;
  std::optional<RunRecorder> recorder_;
  std::optional<RunMembers> members_;
  bool is_interrupted_ = false, has_plant_started_ = false;
};

}  // namespace

int launch(const LaunchOptions& options) {
  return Launcher(options).run();
}

}  // namespace holdfast
