// The plain forwarder that a C programmer writes first: one blocking read, one write, per frame.
#include <errno.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

static int open_can(const char* interface_name) {
  const int yes = 1;
  const int buffer_bytes = 8 << 20;
  struct sockaddr_can address;
  const int can = socket(PF_CAN, SOCK_RAW, CAN_RAW);
  memset(&address, 0, sizeof address);
  address.can_family = AF_CAN;
  address.can_ifindex = (int)if_nametoindex(interface_name);
  if (can < 0 || address.can_ifindex == 0) return -1;
  if (setsockopt(can, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &yes, sizeof yes) != 0) return -1;
  if (setsockopt(can, SOL_SOCKET, SO_RCVBUFFORCE, &buffer_bytes, sizeof buffer_bytes) != 0) {
    setsockopt(can, SOL_SOCKET, SO_RCVBUF, &buffer_bytes, sizeof buffer_bytes);
  }
  return bind(can, (struct sockaddr*)&address, sizeof address) == 0 ? can : -1;
}

int main(int argc, char** argv) {
  if (argc != 3) return fprintf(stderr, "usage: bench_c_forwarder FROM TO\n"), 2;
  const int from = open_can(argv[1]);
  const int to = open_can(argv[2]);
  if (from < 0 || to < 0) return perror("bench_c_forwarder"), 1;
  for (;;) {
    struct canfd_frame frame;
    const ssize_t size = read(from, &frame, sizeof frame);
    if (size <= 0) return perror("bench_c_forwarder: read"), 1;
    if (write(to, &frame, (size_t)size) != size && errno != ENOBUFS) {
      return perror("bench_c_forwarder: write"), 1;
    }
  }
}
