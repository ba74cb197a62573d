#include "drivers/socket_lock.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>

#include "common/errors.h"
#include "common/random_stream.h"

namespace holdfast {

bool SocketLock::try_lock(const std::string& name, int& descriptor) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  // A name longer than the address has room for is told by its hash; the first byte stays zero.
  std::string key = name;
  if (key.size() > sizeof address.sun_path - 2)
    key = "holdfast " + std::to_string(stable_hash(name));
  std::copy(key.begin(), key.end(), address.sun_path + 1);
  descriptor = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (descriptor < 0) return false;
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + key.size());
  if (bind(descriptor, reinterpret_cast<const sockaddr*>(&address), size) == 0) return true;
  close(descriptor);
  descriptor = -1;
  return false;
}

SocketLock::SocketLock(const std::string& name, const std::string& message) {
  if (!try_lock(name, descriptor_)) throw JobError(message);
}

SocketLock::~SocketLock() {
  if (descriptor_ >= 0) close(descriptor_);
}

}  // namespace holdfast
