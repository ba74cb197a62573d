#include "common/lcm_socket_filter.h"

#include <arpa/inet.h>
#include <linux/filter.h>
#include <linux/sock_diag.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <charconv>
#include <filesystem>

namespace holdfast {
namespace {

// The filter sees the UDP header first.
constexpr std::uint32_t kPayload = 8;
constexpr std::uint32_t kShortMagic = 0x4c433032;  // "LC02": magic, seqno, channel, data
constexpr std::uint32_t kLongMagic =
    0x4c433033;  // "LC03": magic, seqno, size, offset, number, count, ...
constexpr std::uint32_t kShortHeaderBytes = 8;
constexpr std::uint32_t kLongHeaderBytes = 20;
constexpr std::uint32_t kDatagramChannelBytesMax = 63;

// A classic BPF program: jumps only lead forwards, so each test is followed by its refusal.
class Program {
 public:
  void load_word(std::uint32_t at) { add(BPF_LD | BPF_W | BPF_ABS, at); }
  void load_half(std::uint32_t at) { add(BPF_LD | BPF_H | BPF_ABS, at); }
  void load_byte(std::uint32_t at) { add(BPF_LD | BPF_B | BPF_ABS, at); }
  void accept() { add(BPF_RET | BPF_K, 0xFFFFFFFFU); }
  void refuse() { add(BPF_RET | BPF_K, 0); }
  void accept_if_zero() {
    add(BPF_JMP | BPF_JEQ | BPF_K, 0, 0, 1);
    accept();
  }
  void refuse_if_above(std::uint32_t bound) {
    add(BPF_JMP | BPF_JGT | BPF_K, bound, 0, 1);
    refuse();
  }
  void copy_to_x() { add(BPF_MISC | BPF_TAX, 0); }
  void refuse_if_above_x() {
    add(BPF_JMP | BPF_JGT | BPF_X, 0, 0, 1);
    refuse();
  }
  // A load beyond the datagram's end refuses it.
  void accept_if_name_ends(std::uint32_t at) {
    for (std::uint32_t i = 0; i <= kDatagramChannelBytesMax; ++i) {
      load_byte(at + i);
      accept_if_zero();
    }
    refuse();
  }
  // Runs what follows only when the word loaded is the given one; the length is filled in by
  // end_if().
  void begin_if(std::uint32_t value) {
    open_.push_back(instructions_.size() + 1);
    add(BPF_JMP | BPF_JEQ | BPF_K, value, 1, 0);
    add(BPF_JMP | BPF_JA, 0);
  }
  void end_if() {
    instructions_[open_.back()].k =
        static_cast<std::uint32_t>(instructions_.size() - open_.back() - 1);
    open_.pop_back();
  }

  sock_fprog program() {
    return {static_cast<unsigned short>(instructions_.size()), instructions_.data()};
  }

 private:
  void add(int code, std::uint32_t k, std::uint8_t if_true = 0, std::uint8_t if_false = 0) {
    instructions_.push_back({static_cast<std::uint16_t>(code), if_true, if_false, k});
  }

  std::vector<sock_filter> instructions_;
  std::vector<std::size_t> open_;
};

Program lcm_program() {
  Program program;
  program.load_word(kPayload);
  program.begin_if(kShortMagic);
  program.accept_if_name_ends(kPayload + kShortHeaderBytes);
  program.end_if();
  program.begin_if(kLongMagic);
  program.load_word(kPayload + 8);
  program.refuse_if_above(kLcmMessageBytesMax);
  program.copy_to_x();
  program.load_word(kPayload + 12);
  // LCM itself tests the fragment's end; it cannot wrap around once the offset is bounded.
  program.refuse_if_above_x();
  program.load_half(kPayload + 16);
  program.begin_if(0);
  program.accept_if_name_ends(kPayload + kLongHeaderBytes);
  program.end_if();
  program.load_half(kPayload + kLongHeaderBytes - 2);
  program.accept();
  program.end_if();
  program.refuse();
  return program;
}

}  // namespace

int udpm_port(const std::string& url) {
  constexpr std::string_view kScheme = "udpm://";
  constexpr int kDefaultPort = 7667;
  if (url.rfind(kScheme, 0) != 0) return 0;
  const std::string address = url.substr(kScheme.size(), url.find('?') - kScheme.size());
  const auto colon = address.find(':');
  int port = kDefaultPort;
  if (colon != std::string::npos) {
    std::from_chars(address.data() + colon + 1, address.data() + address.size(), port);
  }
  return port;
}

std::vector<int> udp_sockets_on_port(int port) {
  std::vector<int> sockets;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd", error)) {
    const int descriptor = std::stoi(entry.path().filename().string());
    sockaddr_in address{};
    socklen_t size = sizeof address;
    int type = 0;
    socklen_t type_size = sizeof type;
    if (getsockopt(descriptor, SOL_SOCKET, SO_TYPE, &type, &type_size) == 0 && type == SOCK_DGRAM &&
        getsockname(descriptor, reinterpret_cast<sockaddr*>(&address), &size) == 0 &&
        address.sin_family == AF_INET && ntohs(address.sin_port) == port) {
      sockets.push_back(descriptor);
    }
  }
  return sockets;
}

bool attach_lcm_filter(int socket) {
  Program filter = lcm_program();
  const sock_fprog program = filter.program();
  return setsockopt(socket, SOL_SOCKET, SO_ATTACH_FILTER, &program, sizeof program) == 0;
}

std::int64_t socket_drops(int socket) {
  std::array<std::uint32_t, SK_MEMINFO_VARS> memory{};
  socklen_t size = sizeof memory;
  if (getsockopt(socket, SOL_SOCKET, SO_MEMINFO, memory.data(), &size) != 0) return 0;
  return memory[SK_MEMINFO_DROPS];
}

}  // namespace holdfast
