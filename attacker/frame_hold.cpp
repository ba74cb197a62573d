#include "attacker/frame_hold.h"

#include <algorithm>

#include "attacker/attack_match.h"

namespace holdfast {

bool FrameHold::is_later(const Entry& a, const Entry& b) {
  if (a.blocker.due_step != b.blocker.due_step) return a.blocker.due_step > b.blocker.due_step;
  return a.sequence > b.sequence;
}

const FrameHold::Blocker* FrameHold::last_of(AttackRecord::Direction direction,
                                             const CanFrame& frame) const {
  const std::uint32_t key = frame_key(frame.identifier, frame.has(CanFrame::kExtended));
  const Blocker* last = nullptr;
  for (const Entry& entry : entries_) {
    if (entry.key != key || entry.direction != direction || entry.reorders) continue;
    if (last == nullptr || entry.blocker.due_step > last->due_step) last = &entry.blocker;
  }
  return last;
}

bool FrameHold::names(std::size_t rule) const {
  return std::ranges::any_of(entries_, [&](const Entry& entry) {
    return entry.blocker.rule == rule ||
           std::ranges::any_of(slots_[entry.slot].copies,
                               [rule](const FrameCopies& copies) { return copies.rule == rule; });
  });
}

void FrameHold::take(const AttackRecord& record, std::vector<FrameCopies>& copies,
                     std::int64_t due_step, bool reorders) {
  std::size_t slot = slots_.size();
  if (free_.empty()) {
    slots_.emplace_back();
  } else {
    slot = free_.back();
    free_.pop_back();
  }
  slots_[slot].record = record;
  slots_[slot].copies.swap(copies);
  const CanFrame& frame = record.original;
  entries_.push_back({{due_step, record.rule},
                      sequence_++,
                      slot,
                      frame_key(frame.identifier, frame.has(CanFrame::kExtended)),
                      record.direction,
                      reorders});
  std::push_heap(entries_.begin(), entries_.end(), is_later);
}

std::size_t FrameHold::pop() {
  std::pop_heap(entries_.begin(), entries_.end(), is_later);
  const std::size_t slot = entries_.back().slot;
  entries_.pop_back();
  free_.push_back(slot);
  return slot;
}

}  // namespace holdfast
