#include "attacker/proxy_core.h"

#include <algorithm>
#include <set>
#include <utility>

namespace holdfast {
namespace {

constexpr std::uint32_t kNumStandard = 1U << 11;

bool needs_signal(const AttackRule& rule) {
  return !rule.signals.empty() || !rule.match.signal.empty();
}

// Frames may be shorter than the message says, so that the selector is looked at with care.
bool carries(const CanFrame& frame, const DbcSignal& signal,
             const std::optional<DbcSignal>& selector) {
  if (!signal.fits(frame.num_bytes)) return false;
  if (signal.multiplexing != DbcSignal::Multiplexing::kMultiplexed) return true;
  return selector && selector->fits(frame.num_bytes) &&
         signal.is_selected_by(static_cast<std::int64_t>(selector->raw(frame.bytes())));
}

std::int64_t selecting_value(const DbcSignal& signal) {
  return signal.selector_ranges.empty() ? signal.selector_value
                                        : signal.selector_ranges.front().first;
}

std::span<std::uint8_t> payload(CanFrame& frame) {
  return {frame.data.data(), frame.num_bytes};
}

// What the signal is to say, given what it says and what was drawn.
double new_value(AttackRule::Action action, const DbcSignal& signal, const CanFrame& frame,
                 double drawn) {
  if (action == AttackRule::Action::kAdd) return signal.unpack(frame.bytes()) + drawn;
  if (action == AttackRule::Action::kScale) return signal.unpack(frame.bytes()) * drawn;
  return drawn;
}

std::optional<DbcSignal> copy_of(const DbcSignal* signal) {
  return signal == nullptr ? std::nullopt : std::optional<DbcSignal>(*signal);
}

}  // namespace

std::uint32_t ExtendedFrameCounter::next(std::uint32_t identifier, std::int64_t step) {
  std::size_t place = (identifier * 0x9E3779B1U) >> 16;
  for (std::size_t probe = 0; probe < kProbesMax; ++probe, place = (place + 1) % kNumSlots) {
    Slot& slot = slots_[place];
    if (slot.step == step && slot.identifier == identifier) return slot.count++;
    if (slot.step != step) {
      slot = {step, identifier, 1};
      return 0;
    }
  }
  // A flood of tens of thousands of identifiers in one step: these share a count rather than cost
  // memory.
  return slots_[place].count++;
}

ProxyCore::ProxyCore(std::vector<AttackRule> rules, const FrameLayout& layout, std::uint64_t seed,
                     std::uint32_t run, double step_s)
    : rules_(std::move(rules)),
      last_acted_on_(rules_.size(), -1),
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
  for (const AttackRule& rule : rules_) streams_.emplace_back(seed, run, "attack/" + rule.name);
  compile(layout.dbc);
  open_rules();
}

void ProxyCore::compile(const Dbc& dbc) {
  std::vector<std::vector<Candidate>> standard(kNumStandard);
  // First the identifiers that stand by themselves, so that rules by mask reach them in rule order.
  for (const AttackRule& rule : rules_) {
    if (rule.action == AttackRule::Action::kInject ||
        (rule.match.messages.empty() && !needs_signal(rule))) {
      continue;
    }
    for (const DbcMessage& message : dbc.messages) {
      if (message.is_extended && selects(rule.match, message)) {
        extended_[message.identifier];
      }
    }
  }
  for (std::uint32_t rule = 0; rule < rules_.size(); ++rule) {
    const AttackRule& it = rules_[rule];
    if (it.action != AttackRule::Action::kInject && it.match.messages.empty() &&
        !needs_signal(it)) {
      compile_by_identifier(rule, standard);
      continue;
    }
    for (const DbcMessage& message : dbc.messages) {
      const bool is_tick =
          message.identifier == tick_.identifier && message.is_extended == tick_.is_extended;
      if (is_tick || !selects(it.match, message)) continue;
      compile_by_message(rule, message, standard);
    }
  }
  offset_.reserve(kNumStandard + 1);
  for (const auto& list : standard) {
    offset_.push_back(static_cast<std::uint32_t>(candidates_.size()));
    candidates_.insert(candidates_.end(), list.begin(), list.end());
  }
  offset_.push_back(static_cast<std::uint32_t>(candidates_.size()));
  if (!extended_.empty() || !extended_by_mask_.empty()) extended_counts_.allocate();
}

void ProxyCore::compile_by_identifier(std::uint32_t rule,
                                      std::vector<std::vector<Candidate>>& standard) {
  const AttackMatch& match = rules_[rule].match;
  for (std::uint32_t identifier = 0; identifier < kNumStandard; ++identifier) {
    if (match.matches_identifier(identifier, false))
      standard[identifier].push_back({rule, -1, 0, 0});
  }
  if (match.identifier && !match.is_extended) return;
  extended_by_mask_.push_back(
      {rule, -1, match.identifier.value_or(0), match.identifier ? match.mask : 0});
  for (auto& [identifier, list] : extended_) {
    if (match.matches_identifier(identifier, true)) list.push_back({rule, -1, 0, 0});
  }
}

void ProxyCore::compile_by_message(std::uint32_t rule, const DbcMessage& message,
                                   std::vector<std::vector<Candidate>>& standard) {
  Candidate candidate{rule, -1, 0, 0};
  if (needs_signal(rules_[rule])) {
    std::optional<Target> target = make_target(rules_[rule], message);
    if (!target) return;
    candidate.target = static_cast<std::int32_t>(targets_.size());
    targets_.push_back(std::move(*target));
  }
  if (rules_[rule].action == AttackRule::Action::kInject) {
    injections_.push_back(candidate);
    return;
  }
  std::vector<Candidate>& list =
      message.is_extended ? extended_[message.identifier] : standard[message.identifier];
  // A DBC that lists an identifier twice must not make a rule act twice.
  if (list.empty() || list.back().rule != rule) list.push_back(candidate);
}

std::optional<ProxyCore::Target> ProxyCore::make_target(const AttackRule& rule,
                                                        const DbcMessage& message) {
  Target target;
  target.selector = copy_of(message.selector());
  if (!rule.match.signal.empty()) {
    target.compared = copy_of(message.find(rule.match.signal));
    if (!target.compared) return std::nullopt;
  }
  for (const std::string& name : rule.signals) {
    const DbcSignal* signal = message.find(name);
    if (signal == nullptr) return std::nullopt;
    target.acted_on.push_back(*signal);
  }
  if (replays(rule)) {
    target.history = history_for(rule, frame_key(message.identifier, message.is_extended));
  }
  if (rule.action != AttackRule::Action::kInject) return target;
  target.forged = message.empty_frame();
  for (const DbcSignal& signal : target.acted_on) {
    if (!signal.fits(target.forged.num_bytes)) return std::nullopt;
    if (signal.multiplexing == DbcSignal::Multiplexing::kMultiplexed && target.selector) {
      target.selector->set_raw(payload(target.forged),
                               static_cast<std::uint64_t>(selecting_value(signal)));
    }
  }
  if (!rule.counter_signal.empty()) target.counter = copy_of(message.find(rule.counter_signal));
  return target;
}

// Rules that replay one message share its history.
std::int32_t ProxyCore::history_for(const AttackRule& rule, std::uint32_t key) {
  auto found = std::find_if(histories_.begin(), histories_.end(),
                            [key](const FrameHistory& history) { return history.key() == key; });
  if (found == histories_.end()) found = histories_.emplace(found, key);
  found->reach_back(rule.replay.high);
  return static_cast<std::int32_t>(found - histories_.begin());
}

void ProxyCore::remember(const CanFrame& frame) {
  if (frame.has(CanFrame::kRemote)) return;
  const std::uint32_t key = frame_key(frame.identifier, frame.has(CanFrame::kExtended));
  for (FrameHistory& history : histories_) {
    if (history.key() == key) history.remember(step_, frame);
  }
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

std::span<const ProxyCore::Candidate> ProxyCore::candidates(const CanFrame& frame) const {
  if (!frame.has(CanFrame::kExtended)) {
    const std::uint32_t identifier = frame.identifier % kNumStandard;
    return {candidates_.data() + offset_[identifier],
            offset_[identifier + 1] - offset_[identifier]};
  }
  if (!extended_.empty()) {
    const auto found = extended_.find(frame.identifier);
    if (found != extended_.end()) return found->second;
  }
  return extended_by_mask_;
}

std::uint32_t ProxyCore::next_index(const CanFrame& frame) {
  if (frame.has(CanFrame::kExtended)) return extended_counts_.next(frame.identifier, step_);
  StandardCount& entry = standard_counts_[frame.identifier % kNumStandard];
  if (entry.step != step_) entry = {step_, 0};
  return entry.count++;
}

// The conditions on what earlier rules did to this frame.
bool ProxyCore::is_due(const AttackRule& rule, std::int64_t rx_index) const {
  for (const std::uint32_t earlier : rule.given) {
    if (last_acted_on_[earlier] != rx_index) return false;
  }
  for (const std::uint32_t earlier : rule.unless) {
    if (last_acted_on_[earlier] == rx_index) return false;
  }
  return true;
}

bool ProxyCore::can_act(const Candidate& candidate, const CanFrame& frame) const {
  if (((candidate.identifier ^ frame.identifier) & candidate.mask) != 0) return false;
  const AttackRule& rule = rules_[candidate.rule];
  if (frame.has(CanFrame::kRemote)) {
    const bool needs_payload =
        rule.action != AttackRule::Action::kDrop && rule.action != AttackRule::Action::kArm;
    return !needs_payload && candidate.target < 0;
  }
  if (rule.bit >= 8 * frame.num_bytes) return false;
  if (candidate.target < 0) return true;
  const Target& target = targets_[static_cast<std::size_t>(candidate.target)];
  for (const DbcSignal& signal : target.acted_on) {
    if (!carries(frame, signal, target.selector)) return false;
  }
  if (!target.compared) return true;
  if (!carries(frame, *target.compared, target.selector)) return false;
  const double value = target.compared->unpack(frame.bytes());
  return value >= rule.match.at_least && value <= rule.match.at_most;
}

// False, and the frame as it was, when what is to be replayed never came.
bool ProxyCore::write_values(const Candidate& candidate, const DrawPlace& place,
                             CanFrame& frame) const {
  const Target& target = targets_[static_cast<std::size_t>(candidate.target)];
  const AttackRule& rule = rules_[candidate.rule];
  const RandomStream& stream = streams_[candidate.rule];
  if (target.history < 0) {
    for (std::size_t i = 0; i < target.acted_on.size(); ++i) {
      const DbcSignal& signal = target.acted_on[i];
      const double drawn = is_over_time(rule) ? rule.values[i].value * over_time_[candidate.rule]
                                              : value_draw(rule, stream, i, place);
      signal.pack(payload(frame), new_value(rule.action, signal, frame, drawn));
    }
    return true;
  }
  const int delay = delay_draw(rule, stream, place);
  const CanFrame* earlier =
      histories_[static_cast<std::size_t>(target.history)].find(step_ - delay);
  if (earlier == nullptr) return false;
  for (const DbcSignal& signal : target.acted_on) {
    if (!carries(*earlier, signal, target.selector)) return false;
  }
  for (const DbcSignal& signal : target.acted_on) {
    signal.set_raw(payload(frame), signal.raw(earlier->bytes()));
  }
  return true;
}

bool ProxyCore::alter(const Candidate& candidate, const DrawPlace& place, CanFrame& frame) const {
  const AttackRule& rule = rules_[candidate.rule];
  if (rule.action != AttackRule::Action::kFlip) return write_values(candidate, place, frame);
  if (rule.bit >= 0) {
    frame.data[static_cast<std::size_t>(rule.bit) / 8] ^=
        static_cast<std::uint8_t>(1U << (rule.bit % 8));
    return true;
  }
  const Target& target = targets_[static_cast<std::size_t>(candidate.target)];
  const DbcSignal& signal = target.acted_on.front();
  signal.set_raw(payload(frame), signal.raw(frame.bytes()) ^ 1U);
  return true;
}

void ProxyCore::on_frame(const CanFrame& frame, std::vector<CanFrame>& out,
                         std::vector<AttackRecord>& records) {
  const std::int64_t rx_index = counters_.received++;
  const bool is_tick = has_tick_identifier(frame);
  const bool is_end = is_tick && is_current_tick(frame);
  if (is_end) {
    end_step(out, records);
  } else if (is_tick) {
    ++counters_.odd_ticks;
  }
  if (!is_tick) remember(frame);
  const std::span<const Candidate> list =
      is_tick ? std::span<const Candidate>{} : candidates(frame);
  if (list.empty()) {
    ++counters_.passed;
    ++counters_.sent;
    out.push_back(frame);
    return;
  }

  const DrawPlace place = {static_cast<std::uint32_t>(step_),
                           frame_key(frame.identifier, frame.has(CanFrame::kExtended)),
                           next_index(frame)};
  out.push_back(frame);
  CanFrame& forwarded = out.back();
  bool is_touched = false;
  for (const Candidate& candidate : list) {
    const AttackRule& rule = rules_[candidate.rule];
    if (!is_open_[candidate.rule] || !can_act(candidate, forwarded) || !is_due(rule, rx_index)) {
      continue;
    }
    const double draw = decision_draw(rule, streams_[candidate.rule], place);
    if (draw >= rule.probability) continue;
    const bool is_drop = rule.action == AttackRule::Action::kDrop;
    const bool is_arm = rule.action == AttackRule::Action::kArm;
    if (!is_drop && !is_arm && !alter(candidate, place, forwarded)) continue;
    last_acted_on_[candidate.rule] = rx_index;
    if (is_arm) continue;
    if (!is_touched) records.emplace_back();
    AttackRecord& record = records.back();
    record.note(rule.action);
    if (!is_touched || is_drop) {
      record.rule = candidate.rule;
      record.draw = draw;
    }
    is_touched = true;
    if (is_drop) {
      record.disposition = AttackRecord::Disposition::kDropped;
      break;
    }
  }
  if (!is_touched) {
    ++counters_.passed;
    ++counters_.sent;
    return;
  }
  AttackRecord& record = records.back();
  record.step = step_;
  record.rx_index = rx_index;
  record.draw_index = place.index;
  record.original = frame;
  if (record.disposition == AttackRecord::Disposition::kDropped) {
    ++counters_.dropped;
    out.pop_back();
  } else {
    ++counters_.altered;
    record.tx_index = counters_.sent++;
    record.forwarded = forwarded;
  }
}

void ProxyCore::end_step(std::vector<CanFrame>& out, std::vector<AttackRecord>& records) {
  for (const Candidate& candidate : injections_) {
    if (is_open_[candidate.rule]) inject(candidate, out, records);
  }
  ++step_;
  open_rules();
}

void ProxyCore::inject(const Candidate& candidate, std::vector<CanFrame>& out,
                       std::vector<AttackRecord>& records) {
  const AttackRule& rule = rules_[candidate.rule];
  const Target& target = targets_[static_cast<std::size_t>(candidate.target)];
  const RandomStream& stream = streams_[candidate.rule];
  DrawPlace place = {static_cast<std::uint32_t>(step_),
                     frame_key(target.forged.identifier, target.forged.has(CanFrame::kExtended)),
                     0};
  const double draw = decision_draw(rule, stream, place);
  if (draw >= rule.probability) return;
  const int count = count_draw(rule, stream, place);
  for (int i = 0; i < count; ++i) {
    place.index = static_cast<std::uint32_t>(i);
    CanFrame frame = target.forged;
    if (!write_values(candidate, place, frame)) continue;
    if (target.counter && target.counter->fits(frame.num_bytes)) {
      target.counter->set_raw(payload(frame),
                              static_cast<std::uint64_t>(step_ + rule.counter_offset));
    }
    AttackRecord& record = records.emplace_back();
    record.disposition = AttackRecord::Disposition::kInjected;
    record.note(rule.action);
    record.rule = candidate.rule;
    record.step = step_;
    record.tx_index = counters_.sent++;
    record.draw_index = i;
    record.draw = draw;
    record.forwarded = frame;
    out.push_back(frame);
    ++counters_.injected;
  }
}

}  // namespace holdfast
