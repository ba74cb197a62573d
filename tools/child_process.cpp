#include "tools/child_process.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <deque>
#include <fstream>

#include "common/errors.h"

namespace holdfast {

ChildProcess::ChildProcess(std::string name, const std::vector<std::string>& argv,
                           std::string output_file)
    : name_(std::move(name)), output_file_(std::move(output_file)) {
  std::vector<char*> arguments;
  for (const std::string& argument : argv) arguments.push_back(const_cast<char*>(argument.c_str()));
  arguments.push_back(nullptr);
  const pid_t parent = getpid();
  pid_ = fork();
  if (pid_ < 0) throw JobError("cannot start " + name_);
  if (pid_ > 0) return;
  // In the child: only calls that are safe between fork and exec. Its own process group keeps
  // Ctrl-C for the launcher, which then stops everyone in order.
  setpgid(0, 0);
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() != parent) _exit(127);
  const int output = open(output_file_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  if (output >= 0) {
    dup2(output, STDOUT_FILENO);
    dup2(output, STDERR_FILENO);
  }
  const int nothing = open("/dev/null", O_RDONLY);
  if (nothing >= 0) dup2(nothing, STDIN_FILENO);
  execvp(arguments[0], arguments.data());
  const std::string text = std::string("cannot run ") + arguments[0] + "\n";
  [[maybe_unused]] const auto written = write(STDERR_FILENO, text.c_str(), text.size());
  _exit(127);
}

ChildProcess::ChildProcess(ChildProcess&& other) noexcept
    : name_(std::move(other.name_)),
      output_file_(std::move(other.output_file_)),
      pid_(other.pid_),
      state_(other.state_),
      code_(other.code_) {
  other.pid_ = -1;
  other.state_ = State::kExited;
}

ChildProcess::~ChildProcess() {
  if (pid_ <= 0 || poll() != State::kRunning) return;
  send(SIGKILL);
  int status = 0;
  waitpid(pid_, &status, 0);
}

ChildProcess::State ChildProcess::poll() {
  if (state_ != State::kRunning) return state_;
  int status = 0;
  if (waitpid(pid_, &status, WNOHANG) != pid_) return state_;
  state_ = WIFSIGNALED(status) ? State::kKilled : State::kExited;
  code_ = WIFSIGNALED(status) ? WTERMSIG(status) : WEXITSTATUS(status);
  return state_;
}

void ChildProcess::send(int signal) {
  // The whole group: an outside command is a shell with children of its own.
  if (state_ == State::kRunning && pid_ > 0) kill(-pid_, signal);
}

std::string ChildProcess::ending() const {
  if (state_ == State::kRunning) return "still running";
  return (state_ == State::kKilled ? "killed by signal " : "exit status ") + std::to_string(code_);
}

std::string ChildProcess::output_tail(std::size_t num_lines) const {
  std::ifstream stream(output_file_);
  std::deque<std::string> lines;
  for (std::string line; std::getline(stream, line);) {
    lines.push_back(line);
    if (lines.size() > num_lines) lines.pop_front();
  }
  std::string text;
  for (const std::string& line : lines) text += "    " + line + "\n";
  return text;
}

}  // namespace holdfast
