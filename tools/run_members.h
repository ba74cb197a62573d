#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/lcm_link.h"
#include "tools/child_process.h"

namespace holdfast {

/// The processes of a run, and how far their own messages say that they are.
class RunMembers {
 public:
  enum class Role { kOurs, kOutsideEstimator, kOutsidePlant };

  /// Output goes to FOLDER/NAME.txt.
  RunMembers(LcmLink& link, std::string folder, std::int64_t num_steps)
      : link_(link), folder_(std::move(folder)), num_steps_(num_steps) {}
  RunMembers(const RunMembers&) = delete;
  RunMembers& operator=(const RunMembers&) = delete;

  void start(const std::string& name, const std::vector<std::string>& argv, Role role);

  bool are_ready() const;
  /// Names of those that are not, with commas.
  std::string not_ready() const;

  /// What is wrong with a process that has ended, "" when nothing is. Nobody may end before the
  /// plant has started, and an outside estimator not before its last estimate.
  std::string find_failure(bool has_plant_started);

  /// True when our processes succeeded and each outside estimator gave its last step's estimate.
  bool are_done() const;
  /// Changes when any process comes further.
  std::int64_t sum_of_steps() const;
  /// Step of the slowest, an outside plant aside.
  std::int64_t slowest_step() const;
  /// " driver at 7; secure at 6;"
  std::string steps_text() const;

  /// To all of them, and all that they started.
  void send(int signal);
  bool are_gone();
  /// "driver, what kalman started": those that are not; "" when all are gone.
  std::string left_over();

 private:
  struct Member {
    ChildProcess process;
    Role role = Role::kOurs;
    std::int64_t step =
        0;  // of an outside estimator: of its newest estimate; within [0, num_steps]
    std::int32_t state = 0;
    std::int64_t ended_ns = 0;
  };

  bool is_ready(const Member& member) const;
  bool is_done(const Member& member) const;

  LcmLink& link_;
  std::string folder_;
  std::int64_t num_steps_;
  std::vector<Member> members_;
};

}  // namespace holdfast
