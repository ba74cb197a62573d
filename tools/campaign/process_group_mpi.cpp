#include <mpi.h>

#include <cstdlib>
#include <list>

#include "common/errors.h"
#include "tools/campaign/process_group.h"

namespace holdfast {
namespace {

// Starting MPI takes a moment and daemons: only where a launcher asks for it.
bool is_started_by_mpi() {
  for (const char* name : {"OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_RANK", "PMI_SIZE"}) {
    if (std::getenv(name) != nullptr) return true;
  }
  return false;
}

}  // namespace

struct ProcessGroup::Sending {
  struct Message {
    std::vector<std::uint8_t> bytes;
    MPI_Request request = MPI_REQUEST_NULL;
  };
  std::list<Message> messages;

  void sweep() {
    messages.remove_if([](Message& message) {
      int is_done = 0;
      MPI_Test(&message.request, &is_done, MPI_STATUS_IGNORE);
      return is_done != 0;
    });
  }
};

bool has_mpi() {
  return true;
}

ProcessGroup::ProcessGroup() : sending_(std::make_unique<Sending>()) {
  if (!is_started_by_mpi()) return;
  int provided = 0;
  MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &provided);
  is_mpi_ = true;
  if (provided < MPI_THREAD_FUNNELED) throw JobError("this MPI allows no threads beside it");
  MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
  MPI_Comm_size(MPI_COMM_WORLD, &size_);
  MPI_Comm local = MPI_COMM_NULL;
  MPI_Comm_split_type(MPI_COMM_WORLD, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &local);
  MPI_Comm_size(local, &num_local_);
  MPI_Comm_free(&local);
}

ProcessGroup::~ProcessGroup() {
  if (!is_mpi_) return;
  for (Sending::Message& message : sending_->messages)
    MPI_Wait(&message.request, MPI_STATUS_IGNORE);
  MPI_Finalize();
}

void ProcessGroup::send(int to, GroupMessage::Kind kind, std::span<const std::uint8_t> bytes) {
  sending_->sweep();
  Sending::Message& message = sending_->messages.emplace_back();
  message.bytes.assign(bytes.begin(), bytes.end());
  MPI_Isend(message.bytes.data(), static_cast<int>(message.bytes.size()), MPI_BYTE, to,
            static_cast<int>(kind), MPI_COMM_WORLD, &message.request);
}

std::optional<GroupMessage> ProcessGroup::poll() {
  if (size_ == 1) return std::nullopt;
  sending_->sweep();
  int has_one = 0;
  MPI_Status status;
  MPI_Iprobe(MPI_ANY_SOURCE, MPI_ANY_TAG, MPI_COMM_WORLD, &has_one, &status);
  if (has_one == 0) return std::nullopt;
  int size = 0;
  MPI_Get_count(&status, MPI_BYTE, &size);
  GroupMessage message;
  message.kind = static_cast<GroupMessage::Kind>(status.MPI_TAG);
  message.from = status.MPI_SOURCE;
  message.bytes.resize(static_cast<std::size_t>(size));
  MPI_Recv(message.bytes.data(), size, MPI_BYTE, status.MPI_SOURCE, status.MPI_TAG, MPI_COMM_WORLD,
           MPI_STATUS_IGNORE);
  return message;
}

GroupMessage ProcessGroup::wait() {
  MPI_Status status;
  MPI_Probe(MPI_ANY_SOURCE, MPI_ANY_TAG, MPI_COMM_WORLD, &status);
  return *poll();
}

void ProcessGroup::abort(int status) {
  if (is_mpi_ && size_ > 1) MPI_Abort(MPI_COMM_WORLD, status);
}

}  // namespace holdfast
