#include "tools/campaign/run_pool.h"

#include <chrono>

namespace holdfast {

namespace {

// The owner shares the cores with the threads: each time that it wakes costs one of them its cache.
constexpr std::size_t kResultsTogether = 16;

}  // namespace

RunPool::RunPool(const CampaignPlan& plan, int num_threads)
    : plan_(plan), low_water_(static_cast<std::size_t>(num_threads)) {
  for (int i = 0; i < num_threads; ++i) threads_.emplace_back([this] { work(); });
}

RunPool::~RunPool() {
  {
    const std::scoped_lock lock(mutex_);
    is_ending_ = true;
  }
  has_job_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void RunPool::add(const std::vector<CampaignJob>& jobs) {
  {
    const std::scoped_lock lock(mutex_);
    jobs_.insert(jobs_.end(), jobs.begin(), jobs.end());
    wants_jobs_ = false;
  }
  has_job_.notify_all();
}

std::size_t RunPool::num_waiting() {
  const std::scoped_lock lock(mutex_);
  return jobs_.size();
}

std::vector<RunResult> RunPool::take_results(double wait_s) {
  std::unique_lock lock(mutex_);
  has_result_.wait_for(lock, std::chrono::duration<double>(wait_s),
                       [this] { return needs_owner(); });
  if (failure_) std::rethrow_exception(failure_);
  wants_jobs_ = false;
  return std::exchange(results_, {});
}

bool RunPool::needs_owner() const {
  return failure_ || wants_jobs_ || results_.size() >= kResultsTogether ||
         (jobs_.empty() && !results_.empty());
}

void RunPool::work() {
  while (true) {
    CampaignJob job;
    {
      std::unique_lock lock(mutex_);
      has_job_.wait(lock, [this] { return is_ending_ || !jobs_.empty(); });
      if (is_ending_) return;
      job = jobs_.front();
      jobs_.pop_front();
      wants_jobs_ = wants_jobs_ || jobs_.size() + 1 == low_water_;
      if (wants_jobs_) has_result_.notify_one();
    }
    try {
      const auto& point = plan_.points[static_cast<std::size_t>(job.first)];
      RunResult result = simulate_run(point.experiment, job.first, job.second);
      const std::scoped_lock lock(mutex_);
      results_.push_back(std::move(result));
      if (needs_owner()) has_result_.notify_one();
    } catch (...) {
      const std::scoped_lock lock(mutex_);
      if (!failure_) failure_ = std::current_exception();
      has_result_.notify_one();
    }
  }
}

}  // namespace holdfast
