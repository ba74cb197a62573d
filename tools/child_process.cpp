#include "tools/child_process.h"

#include <fcntl.h>
#include <linux/close_range.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <deque>
#include <fstream>

#include "common/errors.h"
#include "tools/printable_text.h"

namespace holdfast {
namespace {

constexpr std::streamoff kTailBytesMax = 16384;

}  // namespace

ChildProcess::ChildProcess(std::string name, const std::vector<std::string>& argv,
                           std::string output_file)
    : name_(std::move(name)), output_file_(std::move(output_file)) {
  std::vector<char*> arguments;
  for (const std::string& argument : argv) arguments.push_back(const_cast<char*>(argument.c_str()));
  arguments.push_back(nullptr);
  const std::string refusal = "cannot run " + argv.at(0) + "\n";
  const pid_t parent = getpid();
  pid_ = fork();
  if (pid_ < 0) throw JobError("cannot start " + name_ + ": " + std::strerror(errno));
  if (pid_ == 0) become(arguments, parent, refusal);
  // Both sides do it: whoever comes first, the group is there before it is signalled.
  setpgid(pid_, pid_);
}

// In the child: only calls that are safe between fork and exec. Its own process group keeps Ctrl-C
// for the launcher, which then stops everyone in order.
void ChildProcess::become(const std::vector<char*>& arguments, pid_t parent,
                          const std::string& refusal) const {
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
  close_range(STDERR_FILENO + 1, ~0U, CLOSE_RANGE_CLOEXEC);
  execvp(arguments[0], arguments.data());
  [[maybe_unused]] const auto written = write(STDERR_FILENO, refusal.c_str(), refusal.size());
  _exit(127);
}

ChildProcess::ChildProcess(ChildProcess&& other) noexcept
    : name_(std::move(other.name_)),
      output_file_(std::move(other.output_file_)),
      pid_(other.pid_),
      state_(other.state_),
      code_(other.code_),
      is_gone_(other.is_gone_) {
  other.pid_ = -1;
  other.state_ = State::kExited;
  other.is_gone_ = true;
}

ChildProcess::~ChildProcess() {
  if (is_gone_ || pid_ <= 0) return;
  send(SIGKILL);
  int status = 0;
  waitpid(pid_, &status, 0);
}

// The ended program stays a zombie until is_gone(): so long its number, which is the group's too,
// can be nobody else's.
ChildProcess::State ChildProcess::poll() {
  if (state_ != State::kRunning) return state_;
  siginfo_t info{};
  if (waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOHANG | WNOWAIT) != 0 ||
      info.si_pid != pid_) {
    return state_;
  }
  state_ = info.si_code == CLD_EXITED ? State::kExited : State::kKilled;
  code_ = info.si_status;
  return state_;
}

void ChildProcess::send(int signal) {
  if (!is_gone_ && pid_ > 0) kill(-pid_, signal);
}

bool ChildProcess::is_gone() {
  if (is_gone_) return true;
  if (poll() == State::kRunning) return false;
  int status = 0;
  while (waitpid(-pid_, &status, WNOHANG) > 0) {
  }
  is_gone_ = kill(-pid_, 0) != 0;
  return is_gone_;
}

std::string ChildProcess::ending() const {
  if (state_ == State::kRunning) return "still running";
  return (state_ == State::kKilled ? "killed by signal " : "exit status ") + std::to_string(code_);
}

std::string ChildProcess::output_tail(std::size_t num_lines) const {
  std::ifstream stream(output_file_, std::ios::binary);
  stream.seekg(0, std::ios::end);
  const std::streamoff size = stream.tellg();
  stream.seekg(std::max<std::streamoff>(0, size - kTailBytesMax));
  std::deque<std::string> lines;
  for (std::string line; std::getline(stream, line);) {
    lines.push_back(line);
    if (lines.size() > num_lines) lines.pop_front();
  }
  std::string text;
  for (const std::string& line : lines) text += "    " + printable(line) + "\n";
  return text;
}

void adopt_orphans() {
  prctl(PR_SET_CHILD_SUBREAPER, 1);
}

std::string shell_quoted(const std::string& text) {
  std::string quoted = "'";
  for (const char c : text) {
    if (c == '\'') {
      quoted += "'\\''";
    } else {
      quoted += c;
    }
  }
  return quoted + "'";
}

}  // namespace holdfast
