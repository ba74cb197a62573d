#include "tests/component/common/datagrams.h"

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <stdexcept>

namespace holdfast::testing {
namespace {

void put(std::vector<std::uint8_t>& bytes, std::uint32_t value, int count) {
  for (int i = count - 1; i >= 0; --i) bytes.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

void put_text(std::vector<std::uint8_t>& bytes, const std::string& text) {
  bytes.insert(bytes.end(), text.begin(), text.end());
  bytes.push_back(0);
}

}  // namespace

Datagrams::Datagrams(const std::string& group, int port) : socket_(socket(AF_INET, SOCK_DGRAM, 0)) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  inet_pton(AF_INET, group.c_str(), &address.sin_addr);
  const unsigned char hops = 0;
  if (socket_ < 0 || setsockopt(socket_, IPPROTO_IP, IP_MULTICAST_TTL, &hops, sizeof hops) != 0 ||
      connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    throw std::runtime_error("no multicast socket");
  }
}

Datagrams::~Datagrams() {
  close(socket_);
}

void Datagrams::send(const std::vector<std::uint8_t>& bytes) const {
  if (::send(socket_, bytes.data(), bytes.size(), 0) < 0)
    throw std::runtime_error("datagram not sent");
}

std::vector<std::uint8_t> Datagrams::small_message(const std::string& channel,
                                                   const std::vector<std::uint8_t>& payload) const {
  std::vector<std::uint8_t> bytes;
  put(bytes, 0x4c433032, 4);  // "LC02"
  put(bytes, 1, 4);
  put_text(bytes, channel);
  bytes.insert(bytes.end(), payload.begin(), payload.end());
  return bytes;
}

std::vector<std::uint8_t> Datagrams::fragment(std::uint32_t sequence, std::uint32_t message_bytes,
                                              std::uint32_t offset, std::uint16_t number,
                                              std::uint16_t count,
                                              const std::string& channel) const {
  std::vector<std::uint8_t> bytes;
  put(bytes, 0x4c433033, 4);  // "LC03"
  put(bytes, sequence, 4);
  put(bytes, message_bytes, 4);
  put(bytes, offset, 4);
  put(bytes, number, 2);
  put(bytes, count, 2);
  if (number == 0) put_text(bytes, channel);
  bytes.insert(bytes.end(), 64, 0x55);
  return bytes;
}

}  // namespace holdfast::testing
