#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace holdfast {

/// A program started by the launcher, its output in a file, and the processes that it starts in
/// turn: all of one process group. It dies with the launcher (SIGTERM).
class ChildProcess {
 public:
  enum class State { kRunning, kExited, kKilled };

  /// Starts argv[0] (searched in PATH when it has no '/'), with no descriptor of ours but stdin
  /// (empty), stdout and stderr (both the file). Throws JobError when it cannot be forked.
  ChildProcess(std::string name, const std::vector<std::string>& argv, std::string output_file);
  ChildProcess(ChildProcess&& other) noexcept;
  ChildProcess& operator=(ChildProcess&&) = delete;
  /// Ends for good what is left of it and of its group.
  ~ChildProcess();

  /// Looks, without waiting, whether the program itself has ended.
  State poll();
  /// To the whole group, also when the program itself has ended.
  void send(int signal);
  /// True when the program and all of its group have ended. Orphans of the group are waited for
  /// where they become our children: adopt_orphans().
  bool is_gone();

  const std::string& name() const { return name_; }
  const std::string& output_file() const { return output_file_; }
  State state() const { return state_; }
  bool is_running() const { return state_ == State::kRunning; }
  bool succeeded() const { return state_ == State::kExited && code_ == 0; }
  /// "exit status 1", "killed by signal 9".
  std::string ending() const;
  /// Last lines of its output, made printable, for messages.
  std::string output_tail(std::size_t num_lines = 5) const;

 private:
  [[noreturn]] void become(const std::vector<char*>& arguments, pid_t parent,
                           const std::string& refusal) const;

  std::string name_, output_file_;
  pid_t pid_ = -1;
  State state_ = State::kRunning;
  int code_ = 0;
  bool is_gone_ = false;
};

/// Makes this process the parent of orphans below it, so that ChildProcess sees them end.
void adopt_orphans();

/// The text as one word for sh, whatever it holds.
std::string shell_quoted(const std::string& text);

}  // namespace holdfast
