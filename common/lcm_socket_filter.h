#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace holdfast {

// LCM's receiving thread trusts the header of a datagram: a fragment whose offset wraps around 32
// bits makes it write outside its memory, and a channel's name without an end makes a length
// negative. Nothing above LCM can stop that, so the kernel refuses such datagrams before LCM's
// socket gets them.

/// LCM's own bound of a message. A channel's name without end shows as a negative length, which is
/// above it.
inline constexpr std::uint32_t kLcmMessageBytesMax = 1U << 28;

/// Port of a udpm URL; 0 for another provider.
int udpm_port(const std::string& url);

/// Descriptors of this process that are UDP sockets bound to the port.
std::vector<int> udp_sockets_on_port(int port);

/// Lets only whole LCM datagrams through: known magic, channel's name that ends within 63 bytes and
/// within the datagram, fragment that lies in its message. Returns false when the kernel does not.
bool attach_lcm_filter(int socket);

/// Datagrams that the kernel dropped at this socket, by the filter or for want of memory; 0 when it
/// does not tell.
std::int64_t socket_drops(int socket);

}  // namespace holdfast
