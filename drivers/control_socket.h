#pragma once

#include <functional>
#include <map>
#include <string>

#include "drivers/event_loop.h"
#include "drivers/file_descriptor.h"

namespace holdfast {

/// A client of a ControlSocket.
class ControlConnection {
 public:
  /// Throws UsageError for a path that is too long, JobError when nobody listens there.
  explicit ControlConnection(const std::string& path);
  /// Sends a line and returns the answer, without its end. Throws JobError when the other side
  /// goes.
  std::string ask(const std::string& line);
  /// Waits for so long, or until the other side says something unasked or goes.
  void wait(double seconds) const;

 private:
  FileDescriptor socket_;
};

/// A local socket on which a program takes orders: a line in, a line out, for any number of
/// clients. A client that asks to be watched must not go, nor be silent for too long: on_lost is
/// called then.
class ControlSocket {
 public:
  /// timeout_s: set it to have the client watched from now on, 0 to end that.
  using Answer = std::function<std::string(const std::string& line, double& timeout_s)>;
  static constexpr std::size_t kLineMax = 1U << 20;
  static constexpr std::size_t kClientsMax = 16;

  /// path: of a socket that this process makes, for its user only, and removes in the end. One that
  /// nobody listens on any more is taken over. Throws JobError when it cannot be made, UsageError
  /// when the path is too long or no socket. The loop must outlive it.
  ControlSocket(EventLoop& loop, const std::string& path, Answer answer,
                std::function<void(const std::string& why)> on_lost);
  ~ControlSocket();
  ControlSocket(const ControlSocket&) = delete;
  ControlSocket& operator=(const ControlSocket&) = delete;

 private:
  struct Client {
    FileDescriptor socket;
    EventLoop::Watch watch, deadline;
    std::string text;
    double timeout_s = 0.0;  // 0: not watched
  };

  void accept();
  void read(int fd);
  bool take_line(int fd, const std::string& line);
  void end(int fd);
  void set_deadline(int fd);

  EventLoop& loop_;
  std::string path_;
  Answer answer_;
  std::function<void(const std::string&)> on_lost_;
  FileDescriptor listener_;
  EventLoop::Watch listening_;
  std::map<int, Client> clients_;
};

}  // namespace holdfast
