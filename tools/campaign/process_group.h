#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

namespace holdfast {

/// A message between the processes of a campaign.
struct GroupMessage {
  enum class Kind { kPlan = 1, kWantJobs, kJobs, kResults, kFailure };

  Kind kind = Kind::kPlan;
  int from = 0;
  std::vector<std::uint8_t> bytes;
};

/// The processes that mpirun (or srun) started together; one by itself otherwise.
///
/// Where mpirun started the program but the build has no MPI, every process would do the whole
/// campaign by itself: the constructor throws UsageError.
class ProcessGroup {
 public:
  ProcessGroup();
  ~ProcessGroup();
  ProcessGroup(const ProcessGroup&) = delete;
  ProcessGroup& operator=(const ProcessGroup&) = delete;

  int rank() const { return rank_; }
  int size() const { return size_; }
  /// Processes of the group on this machine.
  int num_local() const { return num_local_; }

  void send(int to, GroupMessage::Kind kind, std::span<const std::uint8_t> bytes);
  /// The next message, if one has come.
  std::optional<GroupMessage> poll();
  /// Waits for the next message.
  GroupMessage wait();
  /// Ends all processes of the group with this exit status; returns only when there is one.
  void abort(int status);

 private:
  struct Sending;

  int rank_ = 0, size_ = 1, num_local_ = 1;
  bool is_mpi_ = false;
  std::unique_ptr<Sending> sending_;
};

/// True when this build can use several machines.
bool has_mpi();

}  // namespace holdfast
