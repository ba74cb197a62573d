#include "attacker/proxy_core.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace holdfast {
namespace {

constexpr std::uint32_t kNumStandard = 1U << 11;

// Frames may be shorter than the message says, so that the selector is looked at with care.
bool carries(const CanFrame& frame, const DbcSignal& signal,
             const std::optional<DbcSignal>& selector) {
  if (!signal.fits(frame.num_bytes)) return false;
  if (signal.multiplexing != DbcSignal::Multiplexing::kMultiplexed) return true;
  return selector && selector->fits(frame.num_bytes) &&
         signal.is_selected_by(static_cast<std::int64_t>(selector->raw(frame.bytes())));
}

std::span<std::uint8_t> payload(CanFrame& frame) {
  return {frame.data.data(), frame.num_bytes};
}

// To arm others, and to have copies made, is not to touch the frame.
bool leaves_record(const AttackRule& rule) {
  return rule.action != AttackRule::Action::kArm && rule.action != AttackRule::Action::kDuplicate;
}

// What the signal is to say, given what it says and what was drawn.
double new_value(AttackRule::Action action, const DbcSignal& signal, const CanFrame& frame,
                 double drawn) {
  if (action == AttackRule::Action::kAdd) return signal.unpack(frame.bytes()) + drawn;
  if (action == AttackRule::Action::kScale) return signal.unpack(frame.bytes()) * drawn;
  return drawn;
}

}  // namespace

ProxyCore::ProxyCore(std::vector<AttackRule> rules, const FrameLayout& layout, std::uint64_t seed,
                     std::uint32_t run, double step_s)
    : rules_(std::move(rules)),
      table_(rules_, layout),
      commands_(layout),
      acts_(rules_.size()),
      is_bad_(rules_.size(), 0),
      frozen_(table_.num_targets()),
      step_s_(step_s),
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
  for (const AttackRule& rule : rules_) streams_.emplace_back(seed, run, "attack/" + rule.name);
  if (table_.has_extended()) extended_counts_.allocate();
  open_rules();
}

void ProxyCore::advance_in_time(std::size_t index, bool was_open) {
  const AttackRule& rule = rules_[index];
  if (rule.values.front().kind == ValueDistribution::Kind::kRandomWalk) {
    const double added = walk_draw(rule, streams_[index], static_cast<std::uint32_t>(step_));
    over_time_[index] = was_open ? over_time_[index] + added : 0.0;
    return;
  }
  over_time_[index] = rule.waveform.value(step_ - rule.window.first(step_s_), step_s_);
}

void ProxyCore::open_rules() {
  is_open_.resize(rules_.size());
  over_time_.resize(rules_.size());
  for (std::size_t rule = 0; rule < rules_.size(); ++rule) {
    const bool was_open = is_open_[rule] != 0;
    is_open_[rule] = rules_[rule].probability > 0.0 && rules_[rule].window.contains(step_, step_s_);
    if (is_open_[rule] != 0 && rules_[rule].chain && is_by_step(rules_[rule]))
      move_chain(static_cast<std::uint32_t>(rule), {static_cast<std::uint32_t>(step_), 0, 0});
    if (is_open_[rule] != 0 && is_over_time(rules_[rule])) advance_in_time(rule, was_open);
  }
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

void ProxyCore::move_chain(std::uint32_t rule, const DrawPlace& place) {
  const BurstChain& chain = *rules_[rule].chain;
  const double draw = chain_draw(rules_[rule], streams_[rule], place);
  if (draw < (is_bad_[rule] != 0 ? chain.to_good : chain.to_bad)) is_bad_[rule] ^= 1;
}

// Whether the rule acts on a frame on which it may: in its turn, and by its draw.
bool ProxyCore::decides(const RuleCandidate& candidate, const DrawPlace& place, double& draw) {
  const AttackRule& rule = rules_[candidate.rule];
  std::int64_t& chances = acts_[candidate.rule].chances;
  if (rule.action != AttackRule::Action::kInject) ++chances;
  if (chances % rule.every != 0) return false;
  if (rule.chain && !is_by_step(rule)) move_chain(candidate.rule, place);
  draw = decision_draw(rule, streams_[candidate.rule], place);
  if (!rule.chain) return draw < rule.probability;
  return draw < (is_bad_[candidate.rule] != 0 ? rule.chain->in_bad : rule.chain->in_good);
}

// The frames of one step come one after the other; those that an attacker mixes share counts.
std::uint32_t ProxyCore::next_command_index(std::int64_t step) {
  if (command_count_.step != step) command_count_ = {step, 0};
  return command_count_.count++;
}

// The conditions on what earlier rules did to this frame.
bool ProxyCore::is_due(const AttackRule& rule, std::int64_t rx_index) const {
  const auto acted = [this, rx_index](std::uint32_t earlier) {
    return acts_[earlier].last_rx_index == rx_index;
  };
  return std::all_of(rule.given.begin(), rule.given.end(), acted) &&
         std::none_of(rule.unless.begin(), rule.unless.end(), acted);
}

// The same for an injection, which joins no frame: on what they did in this step.
bool ProxyCore::is_due_in_step(const AttackRule& rule) const {
  const auto acted = [this](std::uint32_t earlier) { return acts_[earlier].last_step == step_; };
  return std::all_of(rule.given.begin(), rule.given.end(), acted) &&
         std::none_of(rule.unless.begin(), rule.unless.end(), acted);
}

bool ProxyCore::is_open(const RuleCandidate& candidate, std::int64_t step) const {
  const AttackRule& rule = rules_[candidate.rule];
  if (acts_[candidate.rule].count >= rule.times) return false;
  if (!rule.is_on_way_back) return is_open_[candidate.rule] != 0;
  return rule.probability > 0.0 && rule.window.contains(step, step_s_);
}

bool ProxyCore::can_act(const RuleCandidate& candidate, const CanFrame& frame) const {
  if (((candidate.identifier ^ frame.identifier) & candidate.mask) != 0) return false;
  const AttackRule& rule = rules_[candidate.rule];
  if (!rule.match.matches_content(frame)) return false;
  if (frame.has(CanFrame::kRemote)) {
    using Action = AttackRule::Action;
    const bool needs_payload = rule.action != Action::kDrop && rule.action != Action::kArm &&
                               rule.action != Action::kDuplicate;
    return !needs_payload && candidate.target < 0;
  }
  if (rule.bit >= 8 * frame.num_bytes) return false;
  if (static_cast<std::size_t>(rule.edit.at) + rule.edit.keep.size() > frame.num_bytes)
    return false;
  if (candidate.target < 0) return true;
  const RuleTarget& target = table_.target(candidate);
  for (const DbcSignal& signal : target.acted_on) {
    if (!carries(frame, signal, target.selector)) return false;
  }
  if (!target.compared) return true;
  if (!carries(frame, *target.compared, target.selector)) return false;
  const double value = target.compared->unpack(frame.bytes());
  return value >= rule.match.at_least && value <= rule.match.at_most;
}

// False, and the frame as it was, when what is to be replayed never came.
bool ProxyCore::write_values(const RuleCandidate& candidate, const DrawPlace& place,
                             CanFrame& frame, bool& is_saturated) const {
  const RuleTarget& target = table_.target(candidate);
  const AttackRule& rule = rules_[candidate.rule];
  const RandomStream& stream = streams_[candidate.rule];
  if (target.history < 0) {
    for (std::size_t i = 0; i < target.acted_on.size(); ++i) {
      const DbcSignal& signal = target.acted_on[i];
      const double drawn = is_over_time(rule) ? rule.values[i].value * over_time_[candidate.rule]
                                              : value_draw(rule, stream, i, place);
      const double value = new_value(rule.action, signal, frame, drawn);
      is_saturated = !signal.pack(payload(frame), value) || is_saturated;
    }
    return true;
  }
  const int delay = delay_draw(rule, stream, place);
  const CanFrame* earlier = table_.remembered(target, step_ - delay);
  if (earlier == nullptr) return false;
  for (const DbcSignal& signal : target.acted_on) {
    if (!carries(*earlier, signal, target.selector)) return false;
  }
  for (const DbcSignal& signal : target.acted_on) {
    signal.set_raw(payload(frame), signal.raw(earlier->bytes()));
  }
  return true;
}

void ProxyCore::freeze(const RuleCandidate& candidate, CanFrame& frame) {
  std::optional<CanFrame>& frozen = frozen_[static_cast<std::size_t>(candidate.target)];
  if (!frozen) frozen = frame;
  for (const DbcSignal& signal : table_.target(candidate).acted_on)
    signal.set_raw(payload(frame), signal.raw(frozen->bytes()));
}

bool ProxyCore::alter(const RuleCandidate& candidate, const DrawPlace& place, CanFrame& frame,
                      bool& is_saturated) {
  const AttackRule& rule = rules_[candidate.rule];
  switch (rule.action) {
    case AttackRule::Action::kDrop:
    case AttackRule::Action::kArm:
    case AttackRule::Action::kDuplicate:
      return true;
    case AttackRule::Action::kFreeze:
      freeze(candidate, frame);
      return true;
    case AttackRule::Action::kBits:
      for (std::size_t i = 0; i < rule.edit.keep.size(); ++i) {
        std::uint8_t& byte = frame.data[static_cast<std::size_t>(rule.edit.at) + i];
        byte = static_cast<std::uint8_t>(((byte & rule.edit.keep[i]) | rule.edit.set[i]) ^
                                         rule.edit.flip[i]);
      }
      return true;
    case AttackRule::Action::kFlip:
      break;
    default:
      return write_values(candidate, place, frame, is_saturated);
  }
  if (rule.bit >= 0) {
    frame.data[static_cast<std::size_t>(rule.bit) / 8] ^=
        static_cast<std::uint8_t>(1U << (rule.bit % 8));
    return true;
  }
  const DbcSignal& signal = table_.target(candidate).acted_on.front();
  signal.set_raw(payload(frame), signal.raw(frame.bytes()) ^ 1U);
  return true;
}

// Null for a frame that is none of a protected message, or has not its form any more.
const FrameProtection* ProxyCore::protection_of(const CanFrame& frame) const {
  for (const Protected& it : protected_) {
    if (it.message.matches(frame)) return &it.protection;
  }
  return nullptr;
}

void ProxyCore::pass(const CanFrame& frame, Way way) {
  ++way.counters.passed;
  ++way.counters.sent;
  way.frames.push_back(frame);
}

void ProxyCore::on_frame(const CanFrame& frame, ProxyOutput& out) {
  const std::int64_t rx_index = counters_.received++;
  const bool is_tick = has_tick_identifier(frame);
  if (is_tick && is_current_tick(frame)) {
    end_step(out);
  } else if (is_tick) {
    ++counters_.odd_ticks;
  }
  if (is_tick) return pass(frame, to_monitor(out));
  table_.remember(step_, frame);
  const std::span<const RuleCandidate> list = table_.to_monitor(frame);
  if (list.empty()) return pass(frame, to_monitor(out));
  const DrawPlace place = {static_cast<std::uint32_t>(step_),
                           frame_key(frame.identifier, frame.has(CanFrame::kExtended)),
                           next_index(frame)};
  meet_rules(frame, rx_index, list, place, to_monitor(out));
}

void ProxyCore::on_monitor_frame(const CanFrame& frame, ProxyOutput& out) {
  if (!commands_.has_identifier(frame)) return;
  const std::int64_t rx_index = command_counters_.received++;
  const std::optional<ModeChange> command = commands_.decode(frame);
  // What is no sound command is for the plant to refuse.
  if (!command || table_.to_plant().empty()) return pass(frame, to_plant(out));
  const DrawPlace place = {static_cast<std::uint32_t>(command->from_step),
                           frame_key(frame.identifier, frame.has(CanFrame::kExtended)),
                           next_command_index(command->from_step)};
  meet_rules(frame, rx_index, table_.to_plant(), place, to_plant(out));
}

void ProxyCore::meet_rules(const CanFrame& frame, std::int64_t rx_index,
                           std::span<const RuleCandidate> list, const DrawPlace& place, Way way) {
  way.frames.push_back(frame);
  CanFrame& forwarded = way.frames.back();
  bool is_touched = false, is_saturated = false, is_repaired = true;
  copies_.clear();
  for (const RuleCandidate& candidate : list) {
    const AttackRule& rule = rules_[candidate.rule];
    if (!is_open(candidate, place.step) || !can_act(candidate, forwarded) ||
        !is_due(rule, rx_index)) {
      continue;
    }
    double draw = 0.0;
    if (!decides(candidate, place, draw) || !alter(candidate, place, forwarded, is_saturated)) {
      continue;
    }
    const bool is_drop = rule.action == AttackRule::Action::kDrop;
    Acts& acts = acts_[candidate.rule];
    ++acts.count;
    acts.last_rx_index = rx_index;
    acts.last_step = step_;
    if (rule.action == AttackRule::Action::kDuplicate) copies_.push_back({candidate.rule, draw});
    if (!leaves_record(rule)) continue;
    if (!is_touched) way.records.emplace_back();
    AttackRecord& record = way.records.back();
    record.note(rule.action);
    if (!is_touched || is_drop) {
      record.rule = candidate.rule;
      record.draw = draw;
    }
    is_touched = true;
    is_repaired = is_repaired && rule.repairs;
    if (is_drop) {
      record.disposition = AttackRecord::Disposition::kDropped;
      break;
    }
  }
  if (!is_touched) {
    ++way.counters.passed;
    ++way.counters.sent;
    return send_copies(frame, rx_index, place, is_saturated, way);
  }
  AttackRecord& record = way.records.back();
  record.direction = way.direction;
  record.step = place.step;
  record.rx_index = rx_index;
  record.draw_index = place.index;
  record.original = frame;
  if (record.disposition == AttackRecord::Disposition::kDropped) {
    ++way.counters.dropped;
    way.frames.pop_back();
  } else {
    ++way.counters.altered;
    const FrameProtection* protection = is_repaired ? protection_of(forwarded) : nullptr;
    if (protection != nullptr) protection->seal(payload(forwarded));
    record.tx_index = way.counters.sent++;
    record.forwarded = forwarded;
    record.is_saturated = is_saturated;
    send_copies(frame, rx_index, place, is_saturated, way);
  }
}

// Of the frame that was sent last, behind it.
void ProxyCore::send_copies(const CanFrame& frame, std::int64_t rx_index, const DrawPlace& place,
                            bool is_saturated, Way way) {
  for (const Copies& wanted : copies_) {
    for (int i = 0; i < rules_[wanted.rule].copies; ++i) {
      const CanFrame copy = way.frames.back();
      AttackRecord& record = way.records.emplace_back();
      record.direction = way.direction;
      record.disposition = AttackRecord::Disposition::kDuplicated;
      record.note(AttackRule::Action::kDuplicate);
      record.rule = wanted.rule;
      record.step = place.step;
      record.rx_index = rx_index;
      record.tx_index = way.counters.sent++;
      record.draw_index = place.index;
      record.draw = wanted.draw;
      record.is_saturated = is_saturated;
      record.original = frame;
      record.forwarded = copy;
      way.frames.push_back(copy);
      ++way.counters.duplicated;
    }
  }
}

// An injection has one chance a step, whatever the number of its messages.
void ProxyCore::count_chance(std::uint32_t rule) {
  Acts& acts = acts_[rule];
  if (is_open_[rule] == 0 || acts.last_chance == step_) return;
  acts.last_chance = step_;
  ++acts.chances;
}

void ProxyCore::end_step(ProxyOutput& out) {
  for (const RuleCandidate& candidate : table_.injections()) {
    const AttackRule& rule = rules_[candidate.rule];
    count_chance(candidate.rule);
    if (is_open_[candidate.rule] == 0 || acts_[candidate.rule].count >= rule.times ||
        !is_due_in_step(rule)) {
      continue;
    }
    inject(candidate, rule.is_on_way_back ? to_plant(out) : to_monitor(out));
  }
  for (std::uint32_t rule = 0; rule < rules_.size(); ++rule) {
    if (is_open_[rule] == 0 || !is_over_time(rules_[rule])) continue;
    out.signals.push_back({rule, step_, over_time_[rule]});
  }
  ++step_;
  open_rules();
}

void ProxyCore::inject(const RuleCandidate& candidate, Way way) {
  const AttackRule& rule = rules_[candidate.rule];
  const RuleTarget& target = table_.target(candidate);
  const RandomStream& stream = streams_[candidate.rule];
  DrawPlace place = {static_cast<std::uint32_t>(step_),
                     frame_key(target.forged.identifier, target.forged.has(CanFrame::kExtended)),
                     0};
  double draw = 0.0;
  if (!decides(candidate, place, draw)) return;
  bool has_forged = false;
  const int count = count_draw(rule, stream, place);
  for (int i = 0; i < count; ++i) {
    place.index = static_cast<std::uint32_t>(i);
    CanFrame frame = target.forged;
    bool is_saturated = false;
    if (!write_values(candidate, place, frame, is_saturated)) continue;
    if (target.counter && target.counter->fits(frame.num_bytes)) {
      const std::int64_t counter = step_ + rule.counter_offset;
      // A command's step is no counter that wraps: what lies before the run is merely late.
      target.counter->set_raw(
          payload(frame), static_cast<std::uint64_t>(
                              rule.is_on_way_back ? std::max<std::int64_t>(counter, 0) : counter));
    }
    if (const FrameProtection* protection = rule.repairs ? protection_of(frame) : nullptr) {
      protection->set_counter(payload(frame), step_ + rule.counter_offset);
      protection->seal(payload(frame));
    }
    if (!has_forged) ++acts_[candidate.rule].count;
    has_forged = true;
    AttackRecord& record = way.records.emplace_back();
    record.direction = way.direction;
    record.disposition = AttackRecord::Disposition::kInjected;
    record.note(rule.action);
    record.rule = candidate.rule;
    record.step = step_;
    record.tx_index = way.counters.sent++;
    record.draw_index = i;
    record.draw = draw;
    record.is_saturated = is_saturated;
    record.forwarded = frame;
    way.frames.push_back(frame);
    ++way.counters.injected;
  }
}

}  // namespace holdfast
