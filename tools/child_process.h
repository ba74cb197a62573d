#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace holdfast {

/// A program started by the launcher, its output in a file. Dies with the launcher (SIGTERM).
class ChildProcess {
 public:
  enum class State { kRunning, kExited, kKilled };

  /// Starts argv[0] (searched in PATH when it has no '/'). Throws JobError when it cannot be
  /// forked.
  ChildProcess(std::string name, const std::vector<std::string>& argv, std::string output_file);
  ChildProcess(ChildProcess&& other) noexcept;
  ChildProcess& operator=(ChildProcess&&) = delete;
  /// Ends it for good when it still runs.
  ~ChildProcess();

  /// Looks, without waiting, whether it has ended.
  State poll();
  void send(int signal);

  const std::string& name() const { return name_; }
  const std::string& output_file() const { return output_file_; }
  State state() const { return state_; }
  bool is_running() const { return state_ == State::kRunning; }
  bool succeeded() const { return state_ == State::kExited && code_ == 0; }
  /// "exit status 1", "killed by signal 9".
  std::string ending() const;
  /// Last lines of its output, for messages.
  std::string output_tail(std::size_t num_lines = 5) const;

 private:
  std::string name_, output_file_;
  pid_t pid_ = -1;
  State state_ = State::kRunning;
  int code_ = 0;
};

}  // namespace holdfast
