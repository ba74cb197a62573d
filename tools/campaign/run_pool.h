#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "tools/campaign/campaign_plan.h"
#include "tools/campaign/run_result.h"

namespace holdfast {

/// A run of a sweep point: (point, run).
using CampaignJob = std::pair<std::int64_t, std::int64_t>;

/// Threads that run the jobs they are handed. One owner hands out and collects.
class RunPool {
 public:
  /// The plan must outlive the pool.
  RunPool(const CampaignPlan& plan, int num_threads);
  /// Lets the jobs that run end, and drops the others.
  ~RunPool();
  RunPool(const RunPool&) = delete;
  RunPool& operator=(const RunPool&) = delete;

  void add(const std::vector<CampaignJob>& jobs);
  /// Jobs that no thread has begun.
  std::size_t num_waiting();
  /// Results that are there; waits up to the time until there are some together, the last ones are
  /// there, or the threads will soon need jobs. Throws what a job threw.
  std::vector<RunResult> take_results(double wait_s);

 private:
  void work();
  bool needs_owner() const;

  const CampaignPlan& plan_;
  const std::size_t low_water_;  // of jobs, below which the owner is asked for more
  std::mutex mutex_;
  std::condition_variable has_job_, has_result_;
  std::deque<CampaignJob> jobs_;
  std::vector<RunResult> results_;
  std::exception_ptr failure_;
  bool is_ending_ = false, wants_jobs_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace holdfast
