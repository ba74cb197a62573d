#include "tools/launcher.h"

#include <signal.h>
#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <holdfast/estimate_t.hpp>
#include <holdfast/run_meta_t.hpp>
#include <holdfast/status_t.hpp>
#include <iostream>
#include <map>

#include "common/clock.h"
#include "common/errors.h"
#include "common/log_file.h"
#include "common/run_meta.h"
#include "common/status.h"
#include "drivers/event_loop.h"
#include "tools/child_process.h"
#include "tools/experiment.h"
#include "tools/review_report.h"
#include "tools/run_network.h"

namespace holdfast {
namespace {

constexpr double kPollPeriod_s = 0.02;
constexpr double kReadyTimeout_s = 30.0;
constexpr double kStopTimeout_s = 5.0;
constexpr double kFlushPeriod_s = 0.1;

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
  std::filesystem::create_directories(runs_folder);
  for (int attempt = 1;; ++attempt) {
    const std::string folder = attempt == 1 ? base : base + "-" + std::to_string(attempt);
    if (std::filesystem::create_directory(folder)) return folder;
  }
}

void replace_all(std::string& text, const std::string& what, const std::string& with) {
  for (std::size_t at = text.find(what); at != std::string::npos;
       at = text.find(what, at + with.size())) {
    text.replace(at, what.size(), with);
  }
}

// A process of the run, and how far its status messages say that it is.
struct Member {
  ChildProcess process;
  bool is_outside = false;
  std::int64_t step = 0;  // of an outside estimator: of its newest estimate
};

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
    std::ofstream(folder_ + "/scenario.yaml") << experiment_.resolved;
    describe();
    loop_.watch(link_.file_descriptor(), [this] { link_.handle_pending(); });
    loop_.on_stop_signal([this] { is_interrupted_ = true; });
    start_recording();
    loop_.every(1.0, [this] { publish_meta(); });
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
        std::cout << "outside    " << entry.name << ": " << entry.command << "\n";
    }
    if (!experiment_.plant_command.empty())
      std::cout << "outside    plant: " << experiment_.plant_command << "\n";
    std::cout << "look       ";
    if (const char* pid = std::getenv("HOLDFAST_NAMESPACE_PID")) {
      std::cout << "nsenter --preserve-credentials -U -n -t " << pid << " -- ";
    }
    std::cout << "env LCM_DEFAULT_URL='" << network_.lcm_url << "' scripts/spy" << std::endl;
  }

  run_meta_t meta() const {
    return to_message(RunMeta{experiment_.name, experiment_.resolved, experiment_.seed, 0,
                              particle_kernel_name()});
  }

  void publish_meta() {
    run_meta_t message = meta();
    link_.publish("RUN_META", message);
  }

  // Turns the loop until the condition holds; false on failure, signal or time-out.
  bool wait_until(const std::function<bool()>& condition, double timeout_s,
                  const std::string& what) {
    const std::int64_t deadline_ns =
        monotonic_time_ns() + static_cast<std::int64_t>(timeout_s * 1e9);
    bool is_met = false;
    while (!(is_met = condition()) && failure_.empty() && !is_interrupted_) {
      if (monotonic_time_ns() > deadline_ns) {
        fail(what);
        break;
      }
      loop_.run_for(kPollPeriod_s);
      look_for_deaths();
    }
    return is_met && failure_.empty() && !is_interrupted_;
  }

  void fail(const std::string& text) {
    if (!failure_.empty()) return;
    failure_ = text;
    std::cerr << "holdfast-run: " << text << std::endl;
  }

  void look_for_deaths() {
    for (Member& member : members_) {
      if (!member.process.is_running() || member.process.poll() == ChildProcess::State::kRunning)
        continue;
      if (member.process.succeeded() || is_stopping_) continue;
      fail(member.process.name() + " ended before the run was over (" + member.process.ending() +
           "); its last words in " + member.process.output_file() + ":\n" +
           member.process.output_tail());
    }
  }

  // Our own recorder, not lcm-logger: that one keeps LCM's queue of 30 messages per channel and
  // loses what comes faster, without a word. RUN_META is the first event because it is written
  // here.
  void start_recording() {
    log_ = folder_ + "/log.lcm";
    recorder_.emplace(log_);
    run_meta_t first = meta();
    recorder_->write_message("RUN_META", wall_utime(), first);
    recorder_->flush();
    link_.record_all([this](const std::string& channel, std::int64_t utime,
                            std::span<const std::uint8_t> bytes) {
      // LCM's tools refuse events without data.
      if (channel == "LCM_SELF_TEST" || bytes.empty()) return;
      try {
        recorder_->write(channel, utime, {bytes.begin(), bytes.end()});
      } catch (const JobError& error) {
        fail(error.what());
      }
      has_last_word_ = has_last_word_ || (channel == "RUN_META" && is_last_word(bytes));
    });
    loop_.every(kFlushPeriod_s, [this] { recorder_->flush(); });
  }

  bool is_last_word(std::span<const std::uint8_t> bytes) const {
    run_meta_t message;
    return decode_guarded(bytes, message) && message.utime == last_word_utime_;
  }

  // Datagrams reach the recorder in order, so all that came before is written when our last word
  // is.
  void stop_recording() {
    run_meta_t last = meta();
    last_word_utime_ = last.utime;
    link_.publish("RUN_META", last);
    spin_until([this] { return has_last_word_; }, kStopTimeout_s);
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

  void start(const std::string& name, const std::vector<std::string>& argv, bool is_outside) {
    members_.push_back({ChildProcess(name, argv, folder_ + "/" + name + ".txt"), is_outside, 0});
    const std::size_t index = members_.size() - 1;
    link_.subscribe<status_t>(channel_name("STATUS_", name), [this, index](const status_t& status) {
      state_[members_[index].process.name()] = status.state;
      if (!members_[index].is_outside) members_[index].step = status.step;
    });
    if (!is_outside) return;
    link_.subscribe<estimate_t>(
        channel_name("EST_", name), [this, index](const estimate_t& estimate) {
          members_[index].step = std::max(members_[index].step, estimate.step);
        });
  }

  std::vector<std::string> outside_command(std::string text, const std::string& name) const {
    replace_all(text, "{lcm_url}", "'" + network_.lcm_url + "'");
    replace_all(text, "{name}", name);
    replace_all(text, "{scenario}", "'" + folder_ + "/scenario.yaml'");
    replace_all(text, "{sensor_bus}", "'" + network_.sensor_bus + "'");
    return {"sh", "-c", text};
  }

  std::vector<std::string> owned() const {
    if (options_.owned_bus.empty()) return {};
    return {"--i-own-this-bus", options_.owned_bus};
  }

  bool start_members() {
    if (!failure_.empty() || is_interrupted_) return false;
    members_.reserve(experiment_.estimators.size() + 3);
    if (experiment_.has_bus()) {
      start("driver", command("holdfast-can-driver", {"--bus", network_.monitor_bus}), false);
      std::vector<std::string> arguments = {"--from", network_.sensor_bus, "--to",
                                            network_.monitor_bus};
      for (const std::string& argument : owned()) arguments.push_back(argument);
      start("attacker", command("holdfast-attacker", arguments), false);
    }
    for (const EstimatorEntry& entry : experiment_.estimators) {
      if (entry.is_outside()) {
        start(entry.name, outside_command(entry.command, entry.name), true);
      } else if (entry.input == EstimatorEntry::Input::kClean) {
        std::cout << "left out   " << entry.name
                  << ": sees clean readings, which only a campaign has" << std::endl;
      } else {
        start(entry.name, command("holdfast-estimator", {"--name", entry.name}), false);
      }
    }
    const auto all_ready = [this] {
      for (const Member& member : members_) {
        const auto found = state_.find(member.process.name());
        if (found == state_.end() || found->second < static_cast<int>(ProcessState::kReady))
          return false;
      }
      return true;
    };
    return wait_until(all_ready, kReadyTimeout_s,
                      "a process did not say in time that it is ready: " + not_ready());
  }

  std::string not_ready() const {
    return "see the output files in " + folder_ +
           "; an outside command must publish STATUS_<NAME> with state READY";
  }

  bool start_plant() {
    std::vector<std::string> arguments = {"--bus", network_.sensor_bus};
    for (const std::string& argument : owned()) arguments.push_back(argument);
    if (experiment_.plant_command.empty()) {
      start("plant", command("holdfast-plant", arguments), false);
    } else {
      start("plant", outside_command(experiment_.plant_command, "plant"), true);
    }
    return true;
  }

  // Waits for the last step everywhere; a run in which no step comes any more is stalled.
  bool follow() {
    std::int64_t last_sum = -1, last_change_ns = monotonic_time_ns();
    const auto is_over = [&] {
      std::int64_t sum = 0, first = experiment_.num_steps;
      bool is_done = true;
      for (Member& member : members_) {
        sum += member.step;
        if (member.process.name() != "plant" || !member.is_outside)
          first = std::min(first, member.step);
        const bool is_finished =
            member.is_outside ? member.step >= experiment_.num_steps || member.process.succeeded()
                              : member.process.succeeded();
        is_done =
            is_done && (is_finished || (member.is_outside && member.process.name() == "plant"));
      }
      if (sum != last_sum) {
        last_sum = sum;
        last_change_ns = monotonic_time_ns();
        show_progress(first);
      }
      if (!is_done && static_cast<double>(monotonic_time_ns() - last_change_ns) * 1e-9 >
                          options_.stall_timeout_s) {
        fail(stall_text());
      }
      return is_done;
    };
    return wait_until(is_over, 1e9, "");
  }

  std::string stall_text() {
    std::string text =
        "no new step for " + std::to_string(static_cast<int>(options_.stall_timeout_s)) + " s:";
    for (const Member& member : members_) {
      text += " " + member.process.name() + " at " + std::to_string(member.step) + ";";
    }
    return text + " a tick was lost, or a process hangs";
  }

  void show_progress(std::int64_t step) const {
    if (!options_.shows_progress) return;
    std::cout << "\rstep " << step << " of " << experiment_.num_steps << std::flush;
    if (step >= experiment_.num_steps) std::cout << "\n";
  }

  void stop_members() {
    is_stopping_ = true;
    const auto all_ended = [this] {
      bool is_ended = true;
      for (Member& member : members_)
        is_ended = member.process.poll() != ChildProcess::State::kRunning && is_ended;
      return is_ended;
    };
    for (Member& member : members_) member.process.send(SIGTERM);
    spin_until(all_ended, kStopTimeout_s);
    for (Member& member : members_) {
      if (!member.process.is_running()) continue;
      std::cerr << "holdfast-run: " << member.process.name() << " does not stop; killed"
                << std::endl;
      member.process.send(SIGKILL);
    }
    spin_until(all_ended, kStopTimeout_s);
  }

  void spin_until(const std::function<bool()>& condition, double timeout_s) {
    const std::int64_t deadline_ns =
        monotonic_time_ns() + static_cast<std::int64_t>(timeout_s * 1e9);
    while (!condition() && monotonic_time_ns() < deadline_ns) loop_.run_for(kPollPeriod_s);
  }

  std::string report() {
    try {
      return "\n" + write_review_report(log_, folder_) + "\nlog        " + log_ + "\nreport     " +
             folder_ + "/review.txt, review.json\npath       " + folder_ + "/path.svg\n";
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
  std::optional<LogWriter> recorder_;
  std::int64_t last_word_utime_ = -1;
  bool has_last_word_ = false;
  std::vector<Member> members_;
  std::map<std::string, int> state_;
  bool is_interrupted_ = false, is_stopping_ = false;
};

}  // namespace

int launch(const LaunchOptions& options) {
  return Launcher(options).run();
}

}  // namespace holdfast
