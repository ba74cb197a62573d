#pragma once

#include <string>

namespace holdfast {

/// A named lock that one process of this network namespace holds at a time: an abstract UNIX
/// socket, so it goes away with its process, however that ends.
class SocketLock {
 public:
  /// Throws JobError(message) when another process holds the name.
  SocketLock(const std::string& name, const std::string& message);
  ~SocketLock();
  SocketLock(const SocketLock&) = delete;
  SocketLock& operator=(const SocketLock&) = delete;
  SocketLock(SocketLock&& other) noexcept : descriptor_(other.descriptor_) {
    other.descriptor_ = -1;
  }

  /// True and holding, or false; for trying one name after the other.
  static bool try_lock(const std::string& name, int& descriptor);
  /// Takes over a descriptor that try_lock() gave.
  static SocketLock adopt(int descriptor) { return SocketLock(descriptor); }

 private:
  explicit SocketLock(int descriptor) : descriptor_(descriptor) {}

  int descriptor_ = -1;
};

}  // namespace holdfast
