#include "estimators/packet_history.h"

namespace holdfast {

void PacketHistory::clear() {
  first_links_.clear();
  weights_.clear();
  links_.clear();
}

int PacketHistory::add() {
  first_links_.push_back(links_.size());
  weights_.push_back(0.0);
  return static_cast<int>(weights_.size()) - 1;
}

void PacketHistory::link(int entry, double share) {
  if (entry >= 0 && share > 0.0) links_.push_back({entry, share});
}

void PacketHistory::link_packet(int position, double share) {
  if (share > 0.0) links_.push_back({~position, share});
}

void PacketHistory::put(int entry, double weight) {
  if (entry >= 0) weights_[static_cast<std::size_t>(entry)] += weight;
}

// Links lead to earlier entries, so that from the last one on every weight is complete when it is
// passed on.
void PacketHistory::pass_on(std::span<double> packets) {
  std::size_t end = links_.size();
  for (std::size_t entry = weights_.size(); entry-- > 0;) {
    const std::size_t first = first_links_[entry];
    for (std::size_t i = first; i < end; ++i) {
      const Link& link = links_[i];
      double& target = link.target < 0 ? packets[static_cast<std::size_t>(~link.target)]
                                       : weights_[static_cast<std::size_t>(link.target)];
      target += link.share * weights_[entry];
    }
    end = first;
  }
}

}  // namespace holdfast
