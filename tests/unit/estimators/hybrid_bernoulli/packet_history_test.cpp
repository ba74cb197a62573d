#include "estimators/packet_history.h"

#include <vector>

#include "tests/support/catch.h"

using namespace holdfast;

TEST_CASE("a history passes the weights of the last components on to packets of every node") {
  PacketHistory history;
  std::vector<double> packets(4, 0.0);
  // Whatever an earlier step left must be gone.
  history.put(history.add(), 0.0);
  history.link_packet(3, 1.0);
  history.clear();

  // First node: packet 2, packet 0, or neither.
  const int second = history.add();
  history.link_packet(2, 1.0);
  const int first = history.add();
  history.link_packet(0, 1.0);
  const int neither = history.add();
  // Merged between the nodes: packet 2 and neither.
  const int merged = history.add();
  history.link(second, 0.25);
  history.link(neither, 0.75);
  // Second node: packet 1 is authentic, or the node's is lost.
  const int both = history.add();
  history.link(first, 1.0);
  history.link_packet(1, 1.0);
  const int lost = history.add();
  history.link(merged, 1.0);
  history.link(-1, 1.0);
  CHECK(both == 4);
  history.put(both, 0.5);
  history.put(both, 0.1);
  history.put(lost, 0.4);
  history.put(-1, 7.0);
  history.pass_on(packets);
  CHECK(packets[0] == Approx(0.6));
  CHECK(packets[1] == Approx(0.6));
  CHECK(packets[2] == Approx(0.1));
  CHECK(packets[3] == 0.0);
}
