// Orders over a local socket, and what happens when who gave them goes away.
#include "drivers/control_socket.h"

#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <fstream>

#include "common/errors.h"
#include "tests/support/catch.h"
#include "tests/support/temporary_folder.h"

namespace holdfast {
namespace {

FileDescriptor client_of(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path, path.data(), path.size());
  FileDescriptor client(socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0));
  REQUIRE(connect(client.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
  return client;
}

void say(const FileDescriptor& client, const std::string& text) {
  REQUIRE(send(client.get(), text.data(), text.size(), MSG_NOSIGNAL) ==
          static_cast<ssize_t>(text.size()));
}

std::string heard(const FileDescriptor& client) {
  char bytes[4096];
  const ssize_t count = recv(client.get(), bytes, sizeof bytes, 0);
  return count > 0 ? std::string(bytes, static_cast<std::size_t>(count)) : "";
}

struct Served {
  testing::TemporaryFolder folder;
  std::string path = folder.file("s");
  EventLoop loop;
  std::vector<std::string> asked, lost;
  ControlSocket control{loop, path,
                        [this](const std::string& line, double& timeout_s) {
                          asked.push_back(line);
                          if (line == "watch") timeout_s = 0.1;
                          return "to " + line;
                        },
                        [this](const std::string& why) { lost.push_back(why); }};

  void serve() { loop.run_for(0.05); }
};

}  // namespace

TEST_CASE("a line in is a line out, however it is cut, for several clients") {
  Served s;
  struct stat status {};
  REQUIRE(stat(s.path.c_str(), &status) == 0);
  CHECK((status.st_mode & 0777) == 0600);
  const FileDescriptor one = client_of(s.path), other = client_of(s.path);
  say(one, "first\nsec");
  say(other, "hello\n");
  s.serve();
  CHECK(heard(one) == "to first\n");
  CHECK(heard(other) == "to hello\n");
  say(one, "ond\n\n");
  s.serve();
  CHECK(heard(one) == "to second\nto \n");
  CHECK(s.lost.empty());
}

TEST_CASE("a watched client that goes or is silent is missed, another one is not") {
  Served s;
  {
    const FileDescriptor plain = client_of(s.path);
    say(plain, "x\n");
    s.serve();
  }
  s.serve();
  CHECK(s.lost.empty());
  {
    const FileDescriptor watched = client_of(s.path);
    say(watched, "watch\n");
    s.serve();
  }
  s.serve();
  REQUIRE(s.lost.size() == 1);
  CHECK(s.lost[0].find("went away") != std::string::npos);
  const FileDescriptor silent = client_of(s.path);
  say(silent, "watch\n");
  s.loop.run_for(0.05);
  say(silent, "still here\n");
  s.loop.run_for(0.07);
  CHECK(s.lost.size() == 1);
  s.loop.run_for(0.3);
  REQUIRE(s.lost.size() == 2);
  CHECK(s.lost[1].find("silent") != std::string::npos);
  // He is told by the end of the connection, and that end is no second loss.
  CHECK(heard(silent).starts_with("to watch"));
  char byte = 0;
  CHECK(recv(silent.get(), &byte, 1, 0) == 0);
  CHECK(s.lost.size() == 2);
}

TEST_CASE("a client that floods without a line's end is cut off") {
  Served s;
  const FileDescriptor client = client_of(s.path);
  const std::string much(65536, 'x');
  for (std::size_t sent = 0; sent <= ControlSocket::kLineMax + much.size();) {
    const ssize_t count = send(client.get(), much.data(), much.size(), MSG_NOSIGNAL);
    if (count > 0) sent += static_cast<std::size_t>(count);
    if (count < 0 && errno == EPIPE) break;
    s.loop.run_for(0.002);
  }
  s.serve();
  CHECK(send(client.get(), "x", 1, MSG_NOSIGNAL) < 0);
  CHECK(s.asked.empty());
}

TEST_CASE("a path is taken over from the dead only") {
  Served s;
  const auto nothing = [](const std::string&, double&) { return std::string(); };
  EventLoop loop;
  CHECK_THROWS_AS(ControlSocket(loop, s.path, nothing, [](const std::string&) {}), JobError);
  const std::string file = s.folder.file("file");
  std::ofstream(file) << "kept";
  CHECK_THROWS_AS(ControlSocket(loop, file, nothing, [](const std::string&) {}), UsageError);
  CHECK_THROWS_AS(ControlSocket(loop, std::string(200, 'p'), nothing, [](const std::string&) {}),
                  UsageError);
  CHECK_THROWS_AS(
      ControlSocket(loop, s.folder.file("none") + "/s", nothing, [](const std::string&) {}),
      JobError);
  // One that was left behind: bound, but nobody listens.
  const std::string left = s.folder.file("left");
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path, left.data(), left.size());
  {
    const FileDescriptor dead(socket(AF_UNIX, SOCK_STREAM, 0));
    REQUIRE(bind(dead.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
  }
  {
    const ControlSocket control(loop, left, nothing, [](const std::string&) {});
    client_of(left);
  }
  struct stat status {};
  CHECK(stat(left.c_str(), &status) != 0);
}

}  // namespace holdfast
