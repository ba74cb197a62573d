#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "tools/campaign/campaign_plan.h"
#include "tools/campaign/campaign_store.h"
#include "tools/campaign/process_group.h"

namespace holdfast {

struct CampaignOptions {
  int num_threads = 0;  // of this process; 0: its share of the processors it may use
  /// Called now and then with (runs done, of these from earlier, runs in all). May be empty.
  std::function<void(std::int64_t, std::int64_t, std::int64_t)> on_progress;
  /// Asked often; when it says so, what is done is kept and JobError is thrown. May be empty.
  std::function<bool()> should_stop;
};

/// Runs what the store does not hold yet and adds it, together with the other processes of the
/// group: the one of rank 0 hands out ranges of runs and alone writes, all compute.
///
/// The store's content does not depend on threads, processes or interruptions. Throws what a run
/// throws.
void run_campaign(const CampaignPlan& plan, CampaignStore& store, ProcessGroup& group,
                  const CampaignOptions& options);

/// The part of the processes of other ranks: takes plan and jobs from rank 0 until there are none.
void serve_campaign(ProcessGroup& group, const CampaignOptions& options);

/// Processors that this process may use.
int num_usable_processors();

/// The same, shared out among the group's processes on the machine.
int default_threads(const ProcessGroup& group);

}  // namespace holdfast
