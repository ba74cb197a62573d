#include "tools/packet_labels.h"

#include <algorithm>
#include <holdfast/attack_frame_t.hpp>
#include <holdfast/can_frame_t.hpp>

namespace holdfast {
namespace {

// Cells of the table of the exact search: 8 MB, so that a run of 2000 frames is searched whole.
constexpr std::size_t kCellsMax = 4U << 20;
constexpr std::size_t kWindow = 1024;

struct Segment {
  std::size_t sent_begin, sent_end, received_begin, received_end;

  std::size_t num_sent() const { return sent_end - sent_begin; }
  std::size_t num_received() const { return received_end - received_begin; }
  bool is_empty() const { return num_sent() == 0 || num_received() == 0; }
};

class Aligner {
 public:
  Aligner(std::span<const std::int32_t> sent, std::span<const std::int32_t> received)
      : sent_(sent), received_(received), partner_(received.size(), -1) {
    todo_.push_back({0, sent.size(), 0, received.size()});
  }

  std::vector<std::int64_t> run() {
    while (!todo_.empty()) {
      Segment segment = todo_.back();
      todo_.pop_back();
      strip_ends(segment);
      if (segment.is_empty()) continue;
      if (is_affordable(segment)) {
        search(segment, segment.num_sent());
      } else if (!split_at_anchors(segment)) {
        advance_window(segment);
      }
    }
    return std::move(partner_);
  }

 private:
  static bool is_affordable(const Segment& s) {
    return (s.num_sent() + 1) * (s.num_received() + 1) <= kCellsMax;
  }

  void pair(std::size_t sent, std::size_t received) {
    partner_[received] = static_cast<std::int64_t>(sent);
  }

  // Pairing equal ends never makes a common subsequence shorter.
  void strip_ends(Segment& s) {
    while (!s.is_empty() && sent_[s.sent_begin] == received_[s.received_begin]) {
      pair(s.sent_begin++, s.received_begin++);
    }
    while (!s.is_empty() && sent_[s.sent_end - 1] == received_[s.received_end - 1]) {
      pair(--s.sent_end, --s.received_end);
    }
  }

  // Longest common subsequence; takes the first pairs_max pairs and returns where the search stood.
  std::pair<std::size_t, std::size_t> search(const Segment& s, std::size_t pairs_max) {
    const std::size_t rows = s.num_sent(), columns = s.num_received(), width = columns + 1;
    length_.assign((rows + 1) * width, 0);
    for (std::size_t i = rows; i-- > 0;) {
      for (std::size_t j = columns; j-- > 0;) {
        const bool is_equal = sent_[s.sent_begin + i] == received_[s.received_begin + j];
        length_[i * width + j] =
            is_equal ? static_cast<std::uint16_t>(length_[(i + 1) * width + j + 1] + 1)
                     : std::max(length_[(i + 1) * width + j], length_[i * width + j + 1]);
      }
    }
    std::size_t i = 0, j = 0, pairs = 0;
    while (i < rows && j < columns && pairs < pairs_max) {
      if (sent_[s.sent_begin + i] == received_[s.received_begin + j]) {
        pair(s.sent_begin + i++, s.received_begin + j++);
        ++pairs;
      } else if (length_[(i + 1) * width + j] >= length_[i * width + j + 1]) {
        ++i;
      } else {
        ++j;
      }
    }
    return {s.sent_begin + i, s.received_begin + j};
  }

  // Pairs the elements that stand exactly once on both sides, in the longest order that both share
  // (patience sorting), and leaves the pieces between them to be done.
  bool split_at_anchors(const Segment& s) {
    struct Places {
      std::size_t sent = 0, received = 0, num_sent = 0, num_received = 0;
    };
    std::unordered_map<std::int32_t, Places> places;
    for (std::size_t i = s.sent_begin; i < s.sent_end; ++i) {
      Places& at = places[sent_[i]];
      at.sent = i;
      ++at.num_sent;
    }
    for (std::size_t j = s.received_begin; j < s.received_end; ++j) {
      Places& at = places[received_[j]];
      at.received = j;
      ++at.num_received;
    }
    std::vector<std::pair<std::size_t, std::size_t>> anchors;
    for (std::size_t i = s.sent_begin; i < s.sent_end; ++i) {
      const Places& at = places[sent_[i]];
      if (at.num_sent == 1 && at.num_received == 1) anchors.emplace_back(i, at.received);
    }
    if (anchors.empty()) return false;
    Segment rest = s;
    for (const auto& [sent, received] : longest_increasing(anchors)) {
      pair(sent, received);
      todo_.push_back({rest.sent_begin, sent, rest.received_begin, received});
      rest.sent_begin = sent + 1;
      rest.received_begin = received + 1;
    }
    todo_.push_back(rest);
    return true;
  }

  static std::vector<std::pair<std::size_t, std::size_t>> longest_increasing(
      const std::vector<std::pair<std::size_t, std::size_t>>& anchors) {
    constexpr std::size_t kNone = static_cast<std::size_t>(-1);
    std::vector<std::size_t> tail, before(anchors.size(), kNone);
    for (std::size_t a = 0; a < anchors.size(); ++a) {
      const auto place =
          std::lower_bound(tail.begin(), tail.end(), anchors[a].second,
                           [&](std::size_t t, std::size_t r) { return anchors[t].second < r; });
      if (place != tail.begin()) before[a] = *(place - 1);
      if (place == tail.end()) {
        tail.push_back(a);
      } else {
        *place = a;
      }
    }
    std::vector<std::pair<std::size_t, std::size_t>> chain;
    for (std::size_t a = tail.back(); a != kNone; a = before[a]) chain.push_back(anchors[a]);
    std::reverse(chain.begin(), chain.end());
    return chain;
  }

  // No anchor and too long: settles the first half of a window, where what follows still counts,
  // and goes on from there.
  void advance_window(Segment s) {
    const Segment window = {s.sent_begin, std::min(s.sent_end, s.sent_begin + kWindow),
                            s.received_begin,
                            std::min(s.received_end, s.received_begin + 2 * kWindow)};
    const auto [sent, received] = search(window, kWindow / 2);
    const bool has_pair =
        std::any_of(partner_.begin() + static_cast<std::ptrdiff_t>(s.received_begin),
                    partner_.begin() + static_cast<std::ptrdiff_t>(received),
                    [](std::int64_t p) { return p >= 0; });
    if (has_pair) {
      s.sent_begin = sent;
      s.received_begin = received;
    } else if (!jump_to_equal(s)) {
      return;
    }
    todo_.push_back(s);
  }

  // Nearest place ahead, in elements passed over, at which both sides are equal.
  bool jump_to_equal(Segment& s) const {
    std::unordered_map<std::int32_t, std::size_t> first;
    for (std::size_t i = s.sent_begin; i < s.sent_end; ++i) first.try_emplace(sent_[i], i);
    std::size_t nearest = static_cast<std::size_t>(-1);
    Segment best = s;
    for (std::size_t j = s.received_begin; j < s.received_end; ++j) {
      const auto found = first.find(received_[j]);
      if (found == first.end()) continue;
      const std::size_t distance = found->second - s.sent_begin + j - s.received_begin;
      if (distance >= nearest) continue;
      nearest = distance;
      best.sent_begin = found->second;
      best.received_begin = j;
    }
    s = best;
    return nearest != static_cast<std::size_t>(-1);
  }

  std::span<const std::int32_t> sent_, received_;
  std::vector<std::int64_t> partner_;
  std::vector<Segment> todo_;
  std::vector<std::uint16_t> length_;
};

// Number of holes in the indices up to each position (a jump backwards is none: the process was
// started anew).
std::vector<std::int64_t> holes_before(const std::vector<std::int64_t>& index) {
  std::vector<std::int64_t> holes;
  std::int64_t previous = -1, sum = 0;
  for (const std::int64_t i : index) {
    sum += i > previous + 1 ? 1 : 0;
    holes.push_back(sum);
    previous = i;
  }
  return holes;
}

// Walks the unpaired positions of one side; says for each whether the other side is whole there: no
// hole between the pairs around it, and after the last pair only when its writer ended in order.
template <class OnUnpaired>
void visit_unpaired(const std::vector<std::int64_t>& partner,
                    const std::vector<std::int64_t>& other_index, bool other_is_complete,
                    OnUnpaired on_unpaired) {
  const std::vector<std::int64_t> holes = holes_before(other_index);
  const std::int64_t holes_at_end =
      (holes.empty() ? 0 : holes.back()) + (other_is_complete ? 0 : 1);
  std::vector<std::int64_t> next_holes(partner.size());
  std::int64_t here = holes_at_end;
  for (std::size_t j = partner.size(); j-- > 0;) {
    if (partner[j] >= 0) here = holes[static_cast<std::size_t>(partner[j])];
    next_holes[j] = here;
  }
  here = 0;
  for (std::size_t j = 0; j < partner.size(); ++j) {
    if (partner[j] >= 0) {
      here = holes[static_cast<std::size_t>(partner[j])];
    } else {
      on_unpaired(j, next_holes[j] == here);
    }
  }
}

}  // namespace

const char* to_string(PacketLabel label) {
  switch (label) {
    case PacketLabel::kAuthentic:
      return "authentic";
    case PacketLabel::kAltered:
      return "altered";
    case PacketLabel::kInjected:
      return "injected";
    case PacketLabel::kForeign:
      return "foreign";
    case PacketLabel::kUnknown:
      break;
  }
  return "unknown";
}

std::vector<std::int64_t> align_frames(std::span<const std::int32_t> sent,
                                       std::span<const std::int32_t> received) {
  return Aligner(sent, received).run();
}

LabelledFrame FrameLabels::find(std::int64_t rx_index) const {
  const auto found = by_rx_index.find(rx_index);
  return found == by_rx_index.end() ? LabelledFrame{} : found->second;
}

void PacketLabeler::add(const can_frame_t& frame, Sequence& sequence) {
  // Bit-rate switch and error-state flags are not kept by every bus, so they do not tell frames
  // apart.
  constexpr std::int32_t kTold = int{can_frame_t::EXTENDED} | int{can_frame_t::REMOTE} |
                                 int{can_frame_t::ERROR} | int{can_frame_t::FD};
  const std::int32_t format = frame.flags & kTold;
  std::string bytes = std::to_string(frame.identifier) + '/' + std::to_string(format) + '/';
  bytes.append(frame.data.begin(), frame.data.end());
  const auto key = static_cast<std::int32_t>(key_of_.size());
  sequence.index.push_back(frame.index);
  sequence.key.push_back(key_of_.try_emplace(std::move(bytes), key).first->second);
}

void PacketLabeler::add_received(const can_frame_t& frame) {
  add(frame, received_);
}

void PacketLabeler::add_sent(const can_frame_t& frame) {
  add(frame, sent_);
}

void PacketLabeler::add_attack(const attack_frame_t& attack) {
  if (attack.tx_index < 0) return;
  const bool is_injected = attack.disposition == attack_frame_t::INJECTED ||
                           attack.disposition == attack_frame_t::DUPLICATED;
  if (!is_injected && attack.disposition != attack_frame_t::ALTERED &&
      attack.disposition != attack_frame_t::RELEASED) {
    return;
  }
  // A made frame that a later rule changed is still one that no sensor sent.
  LabelledFrame& frame = touched_[attack.tx_index];
  if (frame.label == PacketLabel::kInjected) return;
  frame.label = is_injected ? PacketLabel::kInjected : PacketLabel::kAltered;
  frame.tx_index = attack.tx_index;
  frame.rule = attack.rule;
}

FrameLabels PacketLabeler::labels(bool received_is_complete, bool sent_is_complete) const {
  FrameLabels result;
  result.has_sent = !sent_.index.empty();
  const auto put = [&](std::size_t j, LabelledFrame frame) {
    ++result.count[frame.label];
    result.by_rx_index.try_emplace(received_.index[j], std::move(frame));
  };
  if (!result.has_sent) {
    for (std::size_t j = 0; j < received_.index.size(); ++j) put(j, {});
    return result;
  }
  const std::vector<std::int64_t> partner = align_frames(sent_.key, received_.key);
  std::vector<std::int64_t> reverse(sent_.index.size(), -1);
  for (std::size_t j = 0; j < partner.size(); ++j) {
    if (partner[j] < 0) continue;
    reverse[static_cast<std::size_t>(partner[j])] = static_cast<std::int64_t>(j);
    const std::int64_t tx_index = sent_.index[static_cast<std::size_t>(partner[j])];
    const auto touched = touched_.find(tx_index);
    put(j, touched != touched_.end() ? touched->second
                                     : LabelledFrame{PacketLabel::kAuthentic, tx_index, ""});
  }
  visit_unpaired(partner, sent_.index, sent_is_complete, [&](std::size_t j, bool is_whole) {
    put(j, {is_whole ? PacketLabel::kForeign : PacketLabel::kUnknown, -1, ""});
  });
  visit_unpaired(reverse, received_.index, received_is_complete, [&](std::size_t, bool is_whole) {
    ++(is_whole ? result.lost : result.lost_unknown);
  });
  return result;
}

}  // namespace holdfast
