#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace holdfast::testing {

/// Sends raw datagrams to a multicast group on loopback, as somebody who is no LCM may.
class Datagrams {
 public:
  /// Throws std::runtime_error when there is no socket.
  Datagrams(const std::string& group, int port);
  ~Datagrams();
  Datagrams(const Datagrams&) = delete;
  Datagrams& operator=(const Datagrams&) = delete;

  void send(const std::vector<std::uint8_t>& bytes) const;
  /// LCM's packet of a whole message: magic, sequence number, channel with its NUL, payload.
  std::vector<std::uint8_t> small_message(const std::string& channel,
                                          const std::vector<std::uint8_t>& payload) const;
  /// LCM's packet of one fragment; the first one carries the channel.
  std::vector<std::uint8_t> fragment(std::uint32_t sequence, std::uint32_t message_bytes,
                                     std::uint32_t offset, std::uint16_t number,
                                     std::uint16_t count, const std::string& channel) const;

 private:
  int socket_ = -1;
};

}  // namespace holdfast::testing
