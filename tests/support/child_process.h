#pragma once

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/clock.h"
#include "drivers/file_descriptor.h"

namespace holdfast::testing {

/// A program that the test started; its standard output is read by lines. Killed with its owner.
class ChildProcess {
 public:
  /// command[0] is searched for along PATH.
  explicit ChildProcess(const std::vector<std::string>& command) {
    int ends[2];
    if (pipe2(ends, O_CLOEXEC) != 0) throw std::runtime_error("no pipe");
    output_ = FileDescriptor(ends[0]);
    const FileDescriptor input(ends[1]);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, input.get(), STDOUT_FILENO);
    std::vector<char*> arguments;
    for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
    arguments.push_back(nullptr);
    const int error =
        posix_spawnp(&id_, arguments[0], &actions, nullptr, arguments.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0) throw std::runtime_error("cannot start " + command[0]);
  }
  ~ChildProcess() {
    if (id_ <= 0) return;
    kill(id_, SIGKILL);
    waitpid(id_, nullptr, 0);
  }
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  /// The next line without its end; throws when none comes in time or the output has ended.
  std::string read_line(double timeout_s = 30.0) {
    const std::int64_t end_ns = monotonic_time_ns() + static_cast<std::int64_t>(timeout_s * 1e9);
    for (;;) {
      const std::size_t line_end = pending_.find('\n');
      if (line_end != std::string::npos) {
        const std::string line = pending_.substr(0, line_end);
        pending_.erase(0, line_end + 1);
        return line;
      }
      const std::int64_t left_ns = end_ns - monotonic_time_ns();
      if (left_ns <= 0) throw std::runtime_error("no line in time");
      pollfd state{output_.get(), POLLIN, 0};
      if (poll(&state, 1, static_cast<int>(left_ns / 1'000'000 + 1)) <= 0) continue;
      char part[4096];
      const ssize_t size = read(output_.get(), part, sizeof part);
      if (size <= 0) throw std::runtime_error("the output has ended");
      pending_.append(part, static_cast<std::size_t>(size));
    }
  }

  /// Waits for its end; exit status, or 128 and the signal that killed it.
  int wait() {
    int status = 0;
    waitpid(id_, &status, 0);
    id_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }

 private:
  pid_t id_ = -1;
  FileDescriptor output_;
  std::string pending_;
};

/// Runs a command to its end; its exit status.
inline int run_command(const std::vector<std::string>& command) {
  return ChildProcess(command).wait();
}

}  // namespace holdfast::testing
