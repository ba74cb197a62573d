#include "tools/report/gnuplot.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <sstream>

#include "common/errors.h"
#include "tools/printable_text.h"

namespace holdfast {
namespace {

constexpr const char* kMissing =
    "gnuplot is not installed, and it draws the pictures: install the Debian package gnuplot-nox "
    "(scripts/setup does)";

// The reading end closes by itself; the writing end is given away early.
class Pipe {
 public:
  Pipe() {
    if (pipe2(ends_, O_CLOEXEC) != 0) {
      throw JobError(std::string("cannot start gnuplot: ") + std::strerror(errno));
    }
  }
  ~Pipe() {
    close(ends_[0]);
    close_input();
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
  int input() const { return ends_[1]; }
  void close_input() {
    if (ends_[1] >= 0) close(ends_[1]);
    ends_[1] = -1;
  }
  std::string read_all() const {
    std::string text;
    char part[4096];
    for (;;) {
      const ssize_t size = read(ends_[0], part, sizeof part);
      if (size < 0 && errno == EINTR) continue;
      if (size <= 0) return text;
      text.append(part, static_cast<std::size_t>(size));
    }
  }

 private:
  int ends_[2] = {-1, -1};
};

int wait_for(pid_t id) {
  int status = 0;
  while (waitpid(id, &status, 0) < 0 && errno == EINTR) {
  }
  return status;
}

}  // namespace

bool has_gnuplot() {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path == nullptr ? "/usr/bin:/bin" : path);
  for (std::string folder; std::getline(folders, folder, ':');) {
    if (access(((folder.empty() ? "." : folder) + "/gnuplot").c_str(), X_OK) == 0) return true;
  }
  return false;
}

void run_gnuplot(const std::filesystem::path& folder, const std::string& script) {
  if (!has_gnuplot()) throw JobError(kMissing);
  Pipe output;
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, output.input(), STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, output.input(), STDERR_FILENO);
  posix_spawn_file_actions_addchdir_np(&actions, folder.c_str());
  std::string words[] = {"gnuplot", "--default-settings", script};
  char* arguments[] = {words[0].data(), words[1].data(), words[2].data(), nullptr};
  pid_t id = -1;
  const int error = posix_spawnp(&id, "gnuplot", &actions, nullptr, arguments, environ);
  posix_spawn_file_actions_destroy(&actions);
  output.close_input();
  if (error != 0) throw JobError(std::string("cannot start gnuplot: ") + std::strerror(error));
  const std::string said = output.read_all();
  const int status = wait_for(id);
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    throw JobError("gnuplot could not draw " + (folder / script).string() + ": " +
                   printable(said, 600));
  }
}

}  // namespace holdfast
