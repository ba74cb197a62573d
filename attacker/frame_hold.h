#pragma once

#include <cstdint>
#include <vector>

#include "attacker/attack_record.h"

namespace holdfast {

/// Frames that rules delay, each until the step in which it is due. Allocates nothing once it has
/// grown to what is held at a time.
class FrameHold {
 public:
  static constexpr std::size_t kFramesMax = 8192;

  struct Held {
    AttackRecord record;              // of the frame: as read, and as it is to be sent
    std::vector<FrameCopies> copies;  // that go out behind it
  };

  bool is_empty() const { return entries_.empty(); }
  bool is_full() const { return entries_.size() >= kFramesMax; }
  std::size_t size() const { return entries_.size(); }

  /// The frame of this way and identifier that is due last, of those that must not be overtaken:
  /// its step and the rule that holds it. Null when there is none.
  struct Blocker {
    std::int64_t due_step = 0;
    std::size_t rule = 0;
  };
  const Blocker* last_of(AttackRecord::Direction direction, const CanFrame& frame) const;

  /// Keeps a frame. reorders: later ones of its identifier may overtake it. Precondition: not full.
  /// Swaps the copies with an empty list.
  void take(const AttackRecord& record, std::vector<FrameCopies>& copies, std::int64_t due_step,
            bool reorders);

  /// True when a frame or a copy of one names the rule.
  bool names(std::size_t rule) const;
  /// Rules have other numbers now: number(old) is the new one.
  template <class Number>
  void renumber_rules(const Number& number) {
    for (Entry& entry : entries_) {
      entry.blocker.rule = number(entry.blocker.rule);
      Held& held = slots_[entry.slot];
      held.record.rule = number(held.record.rule);
      for (FrameCopies& copies : held.copies)
        copies.rule = static_cast<std::uint32_t>(number(copies.rule));
    }
  }

  /// Hands over, in order of their steps and then of their arrival, the frames that are due by this
  /// step: visit(Held&).
  template <class Visit>
  void release(std::int64_t step, const Visit& visit) {
    while (!entries_.empty() && entries_.front().blocker.due_step <= step) {
      const std::size_t slot = pop();
      visit(slots_[slot]);
      slots_[slot].copies.clear();
    }
  }

 private:
  struct Entry {
    Blocker blocker;
    std::int64_t sequence = 0;
    std::size_t slot = 0;
    std::uint32_t key = 0;
    AttackRecord::Direction direction = AttackRecord::Direction::kToMonitor;
    bool reorders = false;
  };
  static bool is_later(const Entry& a, const Entry& b);
  std::size_t pop();

  std::vector<Entry> entries_;  // a heap, the one that is due first in front
  std::vector<Held> slots_;
  std::vector<std::size_t> free_;
  std::int64_t sequence_ = 0;
};

}  // namespace holdfast
