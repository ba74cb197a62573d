#include "drivers/control_socket.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "common/errors.h"

namespace holdfast {
namespace {

sockaddr_un address_of(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.empty() || path.size() >= sizeof address.sun_path)
    throw UsageError("control socket " + path + ": a path of at most " +
                     std::to_string(sizeof address.sun_path - 1) + " bytes is needed");
  std::memcpy(address.sun_path, path.data(), path.size());
  return address;
}

bool somebody_listens(const sockaddr_un& address) {
  const FileDescriptor probe(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  return connect(probe.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
}

}  // namespace

ControlConnection::ControlConnection(const std::string& path) {
  const sockaddr_un address = address_of(path);
  socket_ = FileDescriptor(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  if (connect(socket_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    throw JobError(path + ": nobody listens there: " + std::strerror(errno));
}

std::string ControlConnection::ask(const std::string& line) {
  const std::string text = line + '\n';
  if (send(socket_.get(), text.data(), text.size(), MSG_NOSIGNAL) !=
      static_cast<ssize_t>(text.size()))
    throw JobError("the other side went away");
  std::string answer;
  for (char c = 0; recv(socket_.get(), &c, 1, 0) == 1; answer += c) {
    if (c == '\n') return answer;
  }
  throw JobError("the other side went away, or watches no more because this one was silent");
}

void ControlConnection::wait(double seconds) const {
  pollfd ended{socket_.get(), POLLIN, 0};
  poll(&ended, 1, static_cast<int>(1000.0 * seconds));
}

ControlSocket::ControlSocket(EventLoop& loop, const std::string& path, Answer answer,
                             std::function<void(const std::string&)> on_lost)
    : loop_(loop), answer_(std::move(answer)), on_lost_(std::move(on_lost)) {
  const sockaddr_un address = address_of(path);
  struct stat status {};
  if (lstat(path.c_str(), &status) == 0) {
    if (!S_ISSOCK(status.st_mode))
      throw UsageError("control socket " + path + ": is a file already");
    if (somebody_listens(address))
      throw JobError("control socket " + path + ": another process listens there");
    unlink(path.c_str());
  }
  listener_ = FileDescriptor(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const mode_t old_mask = umask(0177);
  const bool is_bound =
      listener_.is_open() &&
      bind(listener_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  const int reason = errno;
  umask(old_mask);
  if (!is_bound || listen(listener_.get(), 8) != 0)
    throw JobError("control socket " + path + ": cannot be made: " + std::strerror(reason));
  path_ = path;
  listening_ = loop_.watch(listener_.get(), [this] { accept(); });
}

ControlSocket::~ControlSocket() {
  listening_.stop();
  for (auto& [fd, client] : clients_) {
    client.watch.stop();
    client.deadline.stop();
  }
  if (!path_.empty()) unlink(path_.c_str());
}

void ControlSocket::accept() {
  while (true) {
    FileDescriptor socket(accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
    if (!socket.is_open()) return;
    if (clients_.size() >= kClientsMax) continue;
    const int fd = socket.get();
    Client& client = clients_[fd];
    client.socket = std::move(socket);
    client.watch = loop_.watch(fd, [this, fd] { read(fd); });
  }
}

void ControlSocket::read(int fd) {
  std::array<char, 4096> bytes;
  const ssize_t count = recv(fd, bytes.data(), bytes.size(), 0);
  if (count < 0 && (errno == EAGAIN || errno == EINTR)) return;
  if (count <= 0) return end(fd);
  Client& client = clients_.at(fd);
  client.text.append(bytes.data(), static_cast<std::size_t>(count));
  std::size_t end_of_line = 0;
  while ((end_of_line = client.text.find('\n')) != std::string::npos) {
    const std::string line = client.text.substr(0, end_of_line);
    client.text.erase(0, end_of_line + 1);
    if (!take_line(fd, line)) return end(fd);
  }
  if (client.text.size() > kLineMax) return end(fd);
  set_deadline(fd);
}

bool ControlSocket::take_line(int fd, const std::string& line) {
  const std::string text = answer_(line, clients_.at(fd).timeout_s) + '\n';
  // Who does not read his answers has no claim to more.
  return send(fd, text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT) ==
         static_cast<ssize_t>(text.size());
}

void ControlSocket::set_deadline(int fd) {
  Client& client = clients_.at(fd);
  client.deadline.stop();
  if (client.timeout_s <= 0.0) return;
  client.deadline = loop_.after(client.timeout_s, [this, fd] {
    clients_.at(fd).timeout_s = 0.0;
    on_lost_("who controls it was silent for too long");
    // He learns of it by the end of the connection, should he still be there.
    end(fd);
  });
}

void ControlSocket::end(int fd) {
  const auto found = clients_.find(fd);
  const bool was_watched = found->second.timeout_s > 0.0;
  found->second.watch.stop();
  found->second.deadline.stop();
  clients_.erase(found);
  if (was_watched) on_lost_("who controls it went away");
}

}  // namespace holdfast
