#include "attacker/proxy_core.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace holdfast {
namespace {

constexpr std::uint32_t kNumStandard = 1U << 11;

std::span<std::uint8_t> payload(CanFrame& frame) {
  return {frame.data.data(), frame.num_bytes};
}

// To arm others, and to have copies made, is not to touch the frame; one that waits gets its record
// when it is taken out of the way.
bool leaves_record(const AttackRule& rule) {
  using Action = AttackRule::Action;
  return rule.action != Action::kArm && rule.action != Action::kDuplicate &&
         rule.action != Action::kDelay;
}

}  // namespace

ProxyCore::ProxyCore(std::vector<AttackRule> rules, const FrameLayout& layout, std::uint64_t seed,
                     std::uint32_t run, double step_s, MonitorModel monitor)
    : seed_(seed),
      run_(run),
      effects_(std::move(rules), layout, seed, run, step_s, std::move(monitor)),
      commands_(layout),
      sensors_(layout.sensors),
      acts_(effects_.rules().size()),
      is_bad_(effects_.rules().size(), 0),
      standard_counts_(kNumStandard) {
  if (const DbcMessage* tick = layout.dbc.find(layout.tick_message)) {
    tick_ = *tick;
    if (const DbcSignal* step = tick->find(layout.tick_signal)) tick_step_ = *step;
  } else {
    tick_.identifier = UINT32_MAX;  // no frame has it: the owner ends the steps
  }
  tick_mask_ =
      tick_step_.num_bits >= 64 ? UINT64_MAX : (std::uint64_t{1} << tick_step_.num_bits) - 1;
  for (const FrameProtection& it : layout.protection) {
    if (const DbcMessage* message = layout.dbc.find(it.message))
      protected_.push_back({*message, it});
  }
  if (effects_.table().has_extended()) extended_counts_.allocate();
  open_rules();
}

bool ProxyCore::has_tick_identifier(const CanFrame& frame) const {
  return frame.identifier == tick_.identifier &&
         frame.has(CanFrame::kExtended) == tick_.is_extended;
}

bool ProxyCore::is_current_tick(const CanFrame& frame) const {
  if (!tick_.matches(frame) || frame.has(CanFrame::kRemote) || !tick_step_.fits(frame.num_bytes))
    return false;
  return ((tick_step_.raw(frame.bytes()) ^ static_cast<std::uint64_t>(step_)) & tick_mask_) == 0;
}

std::uint32_t ProxyCore::next_index(const CanFrame& frame) {
  if (frame.has(CanFrame::kExtended)) return extended_counts_.next(frame.identifier, step_);
  StandardCount& entry = standard_counts_[frame.identifier % kNumStandard];
  if (entry.step != step_) entry = {step_, 0};
  return entry.count++;
}

// The frames of one step come one after the other; those that an attacker mixes share counts.
std::uint32_t ProxyCore::next_command_index(std::int64_t step) {
  if (command_count_.step != step) command_count_ = {step, 0};
  return command_count_.count++;
}

// Null for a frame that is none of a protected message, or has not its form any more.
const FrameProtection* ProxyCore::protection_of(const CanFrame& frame) const {
  for (const Protected& it : protected_) {
    if (it.message.matches(frame)) return &it.protection;
  }
  return nullptr;
}

void ProxyCore::pass(const CanFrame& frame, const Way& way) {
  ++way.counters.passed;
  ++way.counters.sent;
  way.frames.push_back(frame);
  if (way.direction == AttackRecord::Direction::kToMonitor) effects_.on_sent(frame);
}

void ProxyCore::on_frame(const CanFrame& frame, ProxyOutput& out) {
  release(out);
  const std::int64_t rx_index = counters_.received++;
  const bool is_tick = has_tick_identifier(frame);
  if (is_tick && is_current_tick(frame)) {
    end_step(out);
  } else if (is_tick) {
    ++counters_.odd_ticks;
  }
  if (is_tick) return pass(frame, to_monitor(out));
  effects_.remember(step_, frame);
  const std::span<const RuleCandidate> list = effects_.table().to_monitor(frame);
  if (list.empty() && hold_.is_empty()) return pass(frame, to_monitor(out));
  const DrawPlace place = {static_cast<std::uint32_t>(step_),
                           frame_key(frame.identifier, frame.has(CanFrame::kExtended)),
                           // Who meets no rule draws nothing.
                           list.empty() ? 0U : next_index(frame)};
  meet_rules(frame, rx_index, list, place, to_monitor(out));
}

void ProxyCore::on_monitor_frame(const CanFrame& frame, ProxyOutput& out) {
  if (!goes_back(frame)) return;
  const std::int64_t rx_index = command_counters_.received++;
  const std::optional<ModeChange> command = commands_.decode(frame);
  // What is no sound command is for the plant to refuse.
  if (!command || effects_.table().to_plant().empty()) return pass(frame, to_plant(out));
  const DrawPlace place = {static_cast<std::uint32_t>(command->from_step),
                           frame_key(frame.identifier, frame.has(CanFrame::kExtended)),
                           next_command_index(command->from_step)};
  meet_rules(frame, rx_index, effects_.table().to_plant(), place, to_plant(out));
}

// False when the frame ends here. The frame's record is the way's last one, once it is touched.
bool ProxyCore::meet_rule(const RuleCandidate& candidate, std::int64_t rx_index,
                          const DrawPlace& place, const Way& way, Passage& passage) {
  using Action = AttackRule::Action;
  const AttackRule& rule = rules()[candidate.rule];
  CanFrame& forwarded = way.frames.back();
  if (!is_open(candidate, place.step)) {
    if (rule.action == Action::kMasquerade && can_act(candidate, forwarded) &&
        !forwarded.has(CanFrame::kRemote)) {
      effects_.learn(candidate, step_, forwarded);
    }
    return true;
  }
  double draw = 0.0;
  if (!can_act(candidate, forwarded) || !is_due(rule, rx_index) ||
      !decides(candidate, place, draw) ||
      !effects_.apply(candidate, place, step_, forwarded, passage.is_saturated)) {
    return true;
  }
  Acts& acts = acts_[candidate.rule];
  ++acts.count;
  acts.last_rx_index = rx_index;
  acts.last_step = step_;
  if (rule.action == Action::kDuplicate) copies_.push_back({candidate.rule, draw});
  if (rule.action == Action::kDelay) {
    if (passage.delay_steps == 0) {
      passage.delayed_by = candidate.rule;
      passage.delay_draw = draw;
    }
    passage.delay_steps += delay_draw(rule, effects_.stream(candidate.rule), place);
    passage.reorders = passage.reorders || rule.reorders;
  }
  if (!leaves_record(rule)) return true;
  if (!passage.is_touched) way.records.emplace_back().generation = generation_;
  AttackRecord& record = way.records.back();
  record.note(rule.action);
  if (!passage.is_touched || suspends(rule)) {
    record.rule = candidate.rule;
    record.draw = draw;
  }
  passage.is_touched = true;
  passage.is_repaired = passage.is_repaired && rule.repairs;
  if (!suspends(rule)) return true;
  record.disposition = AttackRecord::Disposition::kDropped;
  return false;
}

void ProxyCore::complete_record(const CanFrame& frame, std::int64_t rx_index,
                                const DrawPlace& place, const Passage& passage, const Way& way) {
  AttackRecord& record = way.records.back();
  record.direction = way.direction;
  record.step = place.step;
  record.rx_index = rx_index;
  record.draw_index = place.index;
  record.original = frame;
  if (record.disposition == AttackRecord::Disposition::kDropped) return;
  record.forwarded = way.frames.back();
  record.is_saturated = passage.is_saturated;
}

void ProxyCore::meet_rules(const CanFrame& frame, std::int64_t rx_index,
                           std::span<const RuleCandidate> list, const DrawPlace& place,
                           const Way& way) {
  way.frames.push_back(frame);
  Passage passage;
  copies_.clear();
  bool goes_on = true;
  for (const RuleCandidate& candidate : list) {
    goes_on = meet_rule(candidate, rx_index, place, way, passage);
    if (!goes_on) break;
  }
  if (!goes_on) {
    complete_record(frame, rx_index, place, passage, way);
    ++way.counters.dropped;
    way.frames.pop_back();
    return;
  }
  if (passage.is_touched) {
    CanFrame& forwarded = way.frames.back();
    const FrameProtection* protection = passage.is_repaired ? protection_of(forwarded) : nullptr;
    if (protection != nullptr) protection->seal(payload(forwarded));
  }
  if (hold_back(frame, rx_index, place, passage, way)) return;
  if (way.direction == AttackRecord::Direction::kToMonitor) effects_.on_sent(way.frames.back());
  if (passage.is_touched) {
    complete_record(frame, rx_index, place, passage, way);
    ++way.counters.altered;
    way.records.back().tx_index = way.counters.sent++;
  } else {
    ++way.counters.passed;
    ++way.counters.sent;
  }
  if (copies_.empty()) return;
  AttackRecord of_copies;
  of_copies.generation = generation_;
  of_copies.step = place.step;
  of_copies.rx_index = rx_index;
  of_copies.draw_index = place.index;
  of_copies.is_saturated = passage.is_saturated;
  of_copies.original = frame;
  send_copies(of_copies, copies_, way);
}

// A frame that a rule delays, and one that must not overtake such a frame, waits.
bool ProxyCore::hold_back(const CanFrame& frame, std::int64_t rx_index, const DrawPlace& place,
                          Passage& passage, const Way& way) {
  const FrameHold::Blocker* blocker =
      hold_.is_empty() || passage.reorders ? nullptr : hold_.last_of(way.direction, frame);
  if (passage.delay_steps == 0 && blocker == nullptr) return false;
  if (!passage.is_touched) way.records.emplace_back().generation = generation_;
  complete_record(frame, rx_index, place, passage, way);
  AttackRecord& record = way.records.back();
  record.note(AttackRule::Action::kDelay);
  record.rule = passage.delay_steps > 0 ? passage.delayed_by : blocker->rule;
  record.draw = passage.delay_draw;
  std::int64_t due_step = step_ + passage.delay_steps;
  if (blocker != nullptr) due_step = std::max(due_step, blocker->due_step);
  if (hold_.is_full()) {
    record.disposition = AttackRecord::Disposition::kDropped;
    ++way.counters.dropped;
  } else {
    record.disposition = AttackRecord::Disposition::kHeld;
    ++way.counters.held;
    hold_.take(record, copies_, due_step, passage.reorders);
  }
  record.forwarded = {};
  way.frames.pop_back();
  return true;
}

void ProxyCore::release(ProxyOutput& out) {
  if (hold_.is_empty()) return;
  const std::int64_t due = flushes_ ? std::numeric_limits<std::int64_t>::max() : step_;
  flushes_ = false;
  hold_.release(due, [&](const FrameHold::Held& held) {
    const bool is_command = held.record.direction == AttackRecord::Direction::kToPlant;
    Way way = is_command ? to_plant(out) : to_monitor(out);
    way.frames.push_back(held.record.forwarded);
    way.frames.back().receive_time_ns = 0;  // it is not what was read at that time any more
    AttackRecord& record = way.records.emplace_back(held.record);
    record.disposition = AttackRecord::Disposition::kReleased;
    if (!is_command) record.step = step_;
    record.tx_index = way.counters.sent++;
    ++way.counters.released;
    if (!is_command) effects_.on_sent(way.frames.back());
    const AttackRecord sent = record;
    send_copies(sent, held.copies, way);
  });
}

// Of the frame that was sent last, behind it.
void ProxyCore::send_copies(const AttackRecord& of, std::span<const FrameCopies> copies,
                            const Way& way) {
  for (const FrameCopies& wanted : copies) {
    for (int i = 0; i < rules()[wanted.rule].copies; ++i) {
      const CanFrame copy = way.frames.back();
      AttackRecord& record = way.records.emplace_back(of);
      record.direction = way.direction;
      record.disposition = AttackRecord::Disposition::kDuplicated;
      record.actions = 0;
      record.note(AttackRule::Action::kDuplicate);
      record.rule = wanted.rule;
      record.tx_index = way.counters.sent++;
      record.draw = wanted.draw;
      record.forwarded = copy;
      way.frames.push_back(copy);
      ++way.counters.duplicated;
    }
  }
}

void ProxyCore::end_step(ProxyOutput& out) {
  release(out);
  for (const RuleCandidate& candidate : effects_.table().injections()) {
    const AttackRule& rule = rules()[candidate.rule];
    count_chance(candidate.rule);
    if (is_open_[candidate.rule] == 0 || acts_[candidate.rule].count >= rule.times ||
        !is_due_in_step(rule)) {
      continue;
    }
    inject(candidate, rule.is_on_way_back ? to_plant(out) : to_monitor(out));
  }
  for (std::uint32_t rule = 0; rule < rules().size(); ++rule) {
    if (is_open_[rule] == 0 || !is_over_time(rules()[rule])) continue;
    out.signals.push_back({rule, step_, effects_.over_time(rule)});
  }
  effects_.end_step();
  ++step_;
  open_rules();
}

void ProxyCore::inject(const RuleCandidate& candidate, const Way& way) {
  const AttackRule& rule = rules()[candidate.rule];
  const CanFrame& form = effects_.table().target(candidate).forged;
  DrawPlace place = {static_cast<std::uint32_t>(step_),
                     frame_key(form.identifier, form.has(CanFrame::kExtended)), 0};
  double draw = 0.0;
  int count = 0;
  if (rule.action == AttackRule::Action::kMasquerade) {
    count = effects_.num_due(candidate, step_);
  } else if (decides(candidate, place, draw)) {
    count = count_draw(rule, effects_.stream(candidate.rule), place);
  }
  const std::int64_t sent_before = way.counters.sent;
  for (int i = 0; i < count; ++i) {
    place.index = static_cast<std::uint32_t>(i);
    send_forged(candidate, place, draw, way);
  }
  if (way.counters.sent > sent_before) ++acts_[candidate.rule].count;
}

void ProxyCore::send_forged(const RuleCandidate& candidate, const DrawPlace& place, double draw,
                            const Way& way) {
  const AttackRule& rule = rules()[candidate.rule];
  const RuleTarget& target = effects_.table().target(candidate);
  CanFrame frame;
  bool is_saturated = false;
  if (!effects_.forge(candidate, place, step_, frame, is_saturated)) return;
  const std::int64_t counter = step_ + rule.counter_offset;
  if (target.counter && target.message->carries(*target.counter, frame.bytes())) {
    // A command's step is no counter that wraps: what lies before the run is merely late.
    target.counter->set_raw(
        payload(frame), static_cast<std::uint64_t>(
                            rule.is_on_way_back ? std::max<std::int64_t>(counter, 0) : counter));
  }
  if (const FrameProtection* protection = rule.repairs ? protection_of(frame) : nullptr) {
    protection->set_counter(payload(frame), counter);
    protection->seal(payload(frame));
  }
  AttackRecord& record = way.records.emplace_back();
  record.generation = generation_;
  record.direction = way.direction;
  record.disposition = AttackRecord::Disposition::kInjected;
  record.note(rule.action);
  record.rule = candidate.rule;
  record.step = step_;
  record.tx_index = way.counters.sent++;
  record.draw_index = place.index;
  record.draw = draw;
  record.is_saturated = is_saturated;
  record.forwarded = frame;
  way.frames.push_back(frame);
  ++way.counters.injected;
}

}  // namespace holdfast
