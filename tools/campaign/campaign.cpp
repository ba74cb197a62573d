#include "tools/campaign/campaign.h"

#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "common/clock.h"
#include "tools/campaign/run_pool.h"

namespace holdfast {
namespace {

// For the next results; other processes' wishes are looked at in between.
constexpr double kWaitAlone_s = 0.02, kWait_s = 0.002;
constexpr std::int64_t kCommit_ns = 200'000'000;
constexpr std::size_t kJobsPerRangeMax = 32;

// Jobs that are still to be handed out; ranges get shorter towards the end, so that all end
// together.
class JobRanges {
 public:
  JobRanges(std::vector<CampaignJob> jobs, int num_processes)
      : jobs_(std::move(jobs)), num_processes_(static_cast<std::size_t>(num_processes)) {}

  std::vector<CampaignJob> next(std::size_t num_threads) {
    const std::size_t left = jobs_.size() - next_;
    const std::size_t fair = left / (4 * num_processes_ * num_threads) * num_threads;
    const std::size_t count =
        std::min(left, std::clamp(fair, num_threads, std::max(kJobsPerRangeMax, num_threads)));
    const auto first = jobs_.begin() + static_cast<std::ptrdiff_t>(next_);
    next_ += count;
    return {first, first + static_cast<std::ptrdiff_t>(count)};
  }

 private:
  std::vector<CampaignJob> jobs_;
  std::size_t next_ = 0, num_processes_;
};

std::vector<CampaignJob> missing_from(CampaignStore& store, std::vector<CampaignJob> jobs) {
  const auto done = store.runs();
  std::erase_if(jobs, [&done](const CampaignJob& job) { return done.contains(job); });
  return jobs;
}

std::vector<std::uint8_t> bytes_of_jobs(const std::vector<CampaignJob>& jobs) {
  return nlohmann::json::to_msgpack(jobs);
}

std::vector<CampaignJob> jobs_of(const std::vector<std::uint8_t>& bytes) {
  return nlohmann::json::from_msgpack(bytes).get<std::vector<CampaignJob>>();
}

// What rank 0 does with what the others say. Each of them asks for jobs until it is given none.
class Dispatcher {
 public:
  Dispatcher(ProcessGroup& group, JobRanges& ranges, CampaignStore& store)
      : group_(group), ranges_(ranges), store_(store), num_working_(group.size() - 1) {}

  /// Returns the number of results in the message.
  std::int64_t answer(const GroupMessage& message) {
    if (message.kind == GroupMessage::Kind::kResults) {
      store_.add(run_result_from(message.bytes));
      return 1;
    }
    if (message.kind != GroupMessage::Kind::kWantJobs) {
      throw JobError("process " + std::to_string(message.from) + ": " +
                     std::string(message.bytes.begin(), message.bytes.end()));
    }
    const auto num_threads = nlohmann::json::from_msgpack(message.bytes).get<std::size_t>();
    const std::vector<CampaignJob> jobs = ranges_.next(num_threads);
    group_.send(message.from, GroupMessage::Kind::kJobs, bytes_of_jobs(jobs));
    if (jobs.empty()) --num_working_;
    return 0;
  }

  void dismiss() {
    while (num_working_ > 0) answer(group_.wait());
  }

 private:
  ProcessGroup& group_;
  JobRanges& ranges_;
  CampaignStore& store_;
  int num_working_;
};

}  // namespace

int num_usable_processors() {
  cpu_set_t allowed;
  return sched_getaffinity(0, sizeof allowed, &allowed) == 0 ? std::max(1, CPU_COUNT(&allowed)) : 1;
}

int default_threads(const ProcessGroup& group) {
  const int num_allowed = num_usable_processors();
  // mpirun may have bound each process to processors of its own; unbound ones share them all.
  const bool is_bound = num_allowed < static_cast<int>(sysconf(_SC_NPROCESSORS_ONLN));
  return is_bound ? num_allowed : std::max(1, num_allowed / group.num_local());
}

void run_campaign(const CampaignPlan& plan, CampaignStore& store, ProcessGroup& group,
                  const CampaignOptions& options) {
  const std::vector<CampaignJob> all = plan.jobs();
  const std::vector<CampaignJob> missing = missing_from(store, all);
  const auto num_all = static_cast<std::int64_t>(all.size());
  const std::int64_t num_earlier = num_all - static_cast<std::int64_t>(missing.size());
  std::int64_t num_done = num_earlier;
  const std::vector<std::uint8_t> plan_bytes = to_bytes(plan);
  for (int rank = 1; rank < group.size(); ++rank)
    group.send(rank, GroupMessage::Kind::kPlan, plan_bytes);
  JobRanges ranges(missing, group.size());
  const int num_threads = options.num_threads > 0 ? options.num_threads : default_threads(group);
  RunPool pool(plan, num_threads);
  Dispatcher dispatcher(group, ranges, store);
  const double wait_s = group.size() == 1 ? kWaitAlone_s : kWait_s;
  std::int64_t committed_ns = monotonic_time_ns();
  while (num_done < num_all) {
    if (pool.num_waiting() < static_cast<std::size_t>(num_threads))
      pool.add(ranges.next(static_cast<std::size_t>(num_threads)));
    for (const RunResult& result : pool.take_results(wait_s)) {
      store.add(result);
      ++num_done;
    }
    while (const std::optional<GroupMessage> message = group.poll())
      num_done += dispatcher.answer(*message);
    const std::int64_t now_ns = monotonic_time_ns();
    if (now_ns - committed_ns > kCommit_ns) {
      store.commit();
      committed_ns = now_ns;
    }
    if (options.on_progress) options.on_progress(num_done, num_earlier, num_all);
    if (options.should_stop && options.should_stop() && num_done < num_all) {
      store.commit();
      throw JobError("stopped after " + std::to_string(num_done) + " of " +
                     std::to_string(num_all) + " runs, which " + store.file() +
                     " keeps; the same command goes on");
    }
  }
  store.commit();
  dispatcher.dismiss();
}

void serve_campaign(ProcessGroup& group, const CampaignOptions& options) {
  try {
    GroupMessage message = group.wait();
    const CampaignPlan plan = campaign_plan_from(message.bytes);
    const int num_threads = options.num_threads > 0 ? options.num_threads : default_threads(group);
    const std::vector<std::uint8_t> wish = nlohmann::json::to_msgpack(num_threads);
    RunPool pool(plan, num_threads);
    std::size_t num_held = 0;  // handed to this process, result not yet sent
    bool is_asking = false, is_last = false;
    while (!is_last || num_held > 0) {
      if (!is_last && !is_asking && pool.num_waiting() < static_cast<std::size_t>(num_threads)) {
        group.send(0, GroupMessage::Kind::kWantJobs, wish);
        is_asking = true;
      }
      for (const RunResult& result : pool.take_results(kWait_s)) {
        group.send(0, GroupMessage::Kind::kResults, to_bytes(result));
        --num_held;
      }
      while (const std::optional<GroupMessage> answer = group.poll()) {
        const std::vector<CampaignJob> jobs = jobs_of(answer->bytes);
        is_asking = false;
        is_last = jobs.empty();
        num_held += jobs.size();
        pool.add(jobs);
      }
    }
  } catch (const std::exception& error) {
    const std::string text = error.what();
    group.send(0, GroupMessage::Kind::kFailure,
               std::vector<std::uint8_t>(text.begin(), text.end()));
    group.wait();  // for the end that rank 0 makes of all
  }
}

}  // namespace holdfast
