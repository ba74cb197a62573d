#include <cstdlib>
#include <stdexcept>
#include <string>

#include "common/errors.h"
#include "tools/campaign/process_group.h"

namespace holdfast {

struct ProcessGroup::Sending {};

bool has_mpi() {
  return false;
}

ProcessGroup::ProcessGroup() {
  const char* size = std::getenv("OMPI_COMM_WORLD_SIZE");
  if (size == nullptr) size = std::getenv("PMI_SIZE");
  if (size != nullptr && std::string(size) != "1") {
    throw UsageError(
        "started by mpirun, but this build has no MPI: install libopenmpi-dev and build again, or "
        "use --shard i/n");
  }
}

ProcessGroup::~ProcessGroup() = default;

void ProcessGroup::send(int, GroupMessage::Kind, std::span<const std::uint8_t>) {
  throw std::logic_error("a process by itself has nobody to send to");
}

std::optional<GroupMessage> ProcessGroup::poll() {
  return std::nullopt;
}

GroupMessage ProcessGroup::wait() {
  throw std::logic_error("a process by itself has nobody to hear from");
}

void ProcessGroup::abort(int) {}

}  // namespace holdfast
