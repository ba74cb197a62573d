#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace holdfast {

/// Which packets the components made during one step stand for: a graph that carries their weights
/// after the last node back to the packets of every node, as the backward pass of a smoother does.
///
/// An entry stands for a component, or for what was dropped together. Its weight w is what was put
/// on it and what later entries passed on; a link of share s passes on s w, to an earlier entry or
/// to a packet. O(entries + links); keeps its memory.
class PacketHistory {
 public:
  /// Forgets all entries.
  void clear();
  /// A new entry without links; its index.
  int add();
  /// A link of the newest entry to an earlier one; an entry of -1 is none, and the share is lost.
  void link(int entry, double share);
  /// A link of the newest entry to the packet at a position of the measurement set.
  void link_packet(int position, double share);
  /// Puts weight on an entry; on none when it is -1.
  void put(int entry, double weight);
  /// Passes all weights on and adds to each packet, by position, what reaches it; once.
  void pass_on(std::span<double> packets);

 private:
  struct Link {
    int target = 0;  // an entry, or the complement (~) of a packet's position
    double share = 0.0;
  };

  std::vector<std::size_t> first_links_;  // per entry
  std::vector<double> weights_;           // per entry
  std::vector<Link> links_;
};

}  // namespace holdfast
