#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "drivers/can/dbc.h"

namespace holdfast {
namespace {

// Low bits set; num_bits is 1..64.
std::uint64_t mask(int num_bits) {
  return ~std::uint64_t{0} >> (64 - num_bits);
}

// Calls visit(byte index, lowest bit, bits taken) for each byte that the signal touches, from the
// least significant bits up for Intel order and from the most significant down for Motorola.
template <class Visit>
void for_each_piece(const DbcSignal& signal, Visit visit) {
  auto byte = static_cast<std::size_t>(signal.start_bit / 8);
  int bit = signal.start_bit % 8;
  for (int left = signal.num_bits; left > 0; ++byte) {
    const int room = signal.is_little_endian ? 8 - bit : bit + 1;
    const int taken = std::min(room, left);
    visit(byte, signal.is_little_endian ? bit : bit + 1 - taken, taken);
    left -= taken;
    bit = signal.is_little_endian ? 0 : 7;
  }
}

// Raw bits nearest to the value, for an integer signal; false when it lies outside the range.
bool nearest_integer(const DbcSignal& signal, double value, std::uint64_t& raw) {
  raw = 0;
  if (std::isnan(value)) return false;
  const bool is_signed = signal.kind == DbcSignal::Kind::kSigned;
  const int magnitude_bits = is_signed ? signal.num_bits - 1 : signal.num_bits;
  // First value that is too large.
  const double above =
      magnitude_bits == 64 ? 0x1p64 : static_cast<double>(std::uint64_t{1} << magnitude_bits);
  const double low = is_signed ? -above : 0.0;
  const double rounded = std::round(value);
  if (rounded >= above) {
    raw = magnitude_bits == 0 ? 0 : mask(magnitude_bits);
    return false;
  }
  if (rounded < low) {
    raw = is_signed ? ~std::uint64_t{0} << magnitude_bits : 0;
    return false;
  }
  raw = is_signed ? static_cast<std::uint64_t>(static_cast<std::int64_t>(rounded))
                  : static_cast<std::uint64_t>(rounded);
  return true;
}

// Conversion of a finite double beyond the float range is undefined, so it is cut before.
bool nearest_float(double value, float& nearest) {
  constexpr double kMax = std::numeric_limits<float>::max();
  if (std::isfinite(value) && std::abs(value) > kMax) {
    nearest = static_cast<float>(std::copysign(kMax, value));
    return false;
  }
  nearest = static_cast<float>(value);
  return true;
}

// No range reaches beyond the values of std::int64_t.
std::int64_t value_in(const DbcSignal& selector, std::span<const std::uint8_t> data) {
  constexpr std::uint64_t kMax = std::numeric_limits<std::int64_t>::max();
  const std::uint64_t raw = selector.raw(data);
  return static_cast<std::int64_t>(selector.kind == DbcSignal::Kind::kSigned ? raw
                                                                             : std::min(raw, kMax));
}

// Least and greatest value that the selector can have.
std::pair<std::int64_t, std::int64_t> values_of(const DbcSignal& selector) {
  const bool is_signed = selector.kind == DbcSignal::Kind::kSigned;
  const int magnitude_bits = std::min(is_signed ? selector.num_bits - 1 : selector.num_bits, 63);
  const auto greatest = magnitude_bits == 0 ? 0 : static_cast<std::int64_t>(mask(magnitude_bits));
  return {is_signed ? -greatest - 1 : 0, greatest};
}

// To the least value that carries all of these, which is the first that it can have of some range.
void set_selector(const DbcSignal& selector, const std::vector<const DbcSignal*>& selected,
                  std::span<std::uint8_t> data) {
  const auto [least, greatest] = values_of(selector);
  std::set<std::int64_t> candidates;
  for (const DbcSignal* signal : selected) {
    for (const auto& [first, last] : signal->selector_ranges) {
      const std::int64_t candidate = std::max(first, least);
      if (candidate <= std::min(last, greatest)) candidates.insert(candidate);
    }
  }
  const auto found = std::ranges::find_if(candidates, [&selected](std::int64_t value) {
    return std::ranges::all_of(
        selected, [value](const DbcSignal* signal) { return signal->is_selected_by(value); });
  });
  if (found != candidates.end()) selector.set_raw(data, static_cast<std::uint64_t>(*found));
}

// Length of the UTF-8 sequence at the start of the text; 0 when it is none.
std::size_t utf8_sequence(std::string_view text) {
  const auto at = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned first = at(0);
  if (first < 0x80) return 1;
  const std::size_t length = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : 2;
  if (first < 0xC2 || first > 0xF4 || text.size() < length) return 0;
  for (std::size_t i = 1; i < length; ++i) {
    if ((at(i) & 0xC0U) != 0x80U) return 0;
  }
  // Overlong forms, surrogates and what lies beyond U+10FFFF.
  if ((first == 0xE0 && at(1) < 0xA0) || (first == 0xED && at(1) > 0x9F)) return 0;
  if ((first == 0xF0 && at(1) < 0x90) || (first == 0xF4 && at(1) > 0x8F)) return 0;
  return length;
}

void append_utf8(std::string& text, unsigned code) {
  if (code < 0x80) {
    text += static_cast<char>(code);
  } else if (code < 0x800) {
    text += static_cast<char>(0xC0U | (code >> 6U));
    text += static_cast<char>(0x80U | (code & 0x3FU));
  } else {
    text += static_cast<char>(0xE0U | (code >> 12U));
    text += static_cast<char>(0x80U | ((code >> 6U) & 0x3FU));
    text += static_cast<char>(0x80U | (code & 0x3FU));
  }
}

// Windows-1252 bytes 0x80..0x9F; those without a character stand for themselves.
constexpr std::array<unsigned, 32> kWindows1252 = {
    0x20AC, 0x81,   0x201A, 0x0192, 0x201E, 0x2026, 0x2020, 0x2021, 0x02C6, 0x2030, 0x0160,
    0x2039, 0x0152, 0x8D,   0x017D, 0x8F,   0x90,   0x2018, 0x2019, 0x201C, 0x201D, 0x2022,
    0x2013, 0x2014, 0x02DC, 0x2122, 0x0161, 0x203A, 0x0153, 0x9D,   0x017E, 0x0178};

}  // namespace

std::uint64_t DbcSignal::raw(std::span<const std::uint8_t> data) const {
  std::uint64_t bits = 0;
  int done = 0;
  for_each_piece(*this, [&](std::size_t byte, int low, int taken) {
    const std::uint64_t piece = (static_cast<std::uint64_t>(data[byte]) >> low) & mask(taken);
    bits = is_little_endian ? bits | (piece << done) : (bits << taken) | piece;
    done += taken;
  });
  if (kind == Kind::kSigned && ((bits >> (num_bits - 1)) & 1U) != 0) bits |= ~mask(num_bits);
  return bits;
}

void DbcSignal::set_raw(std::span<std::uint8_t> data, std::uint64_t raw) const {
  int done = 0;
  for_each_piece(*this, [&](std::size_t byte, int low, int taken) {
    const int shift = is_little_endian ? done : num_bits - done - taken;
    const auto kept = static_cast<std::uint64_t>(data[byte]) & ~(mask(taken) << low);
    data[byte] = static_cast<std::uint8_t>(kept | (((raw >> shift) & mask(taken)) << low));
    done += taken;
  });
}

double DbcSignal::unpack(std::span<const std::uint8_t> data) const {
  const std::uint64_t bits = raw(data);
  double value = 0.0;
  switch (kind) {
    case Kind::kUnsigned:
      value = static_cast<double>(bits);
      break;
    case Kind::kSigned:
      value = static_cast<double>(static_cast<std::int64_t>(bits));
      break;
    case Kind::kFloat32:
      value = std::bit_cast<float>(static_cast<std::uint32_t>(bits));
      break;
    case Kind::kFloat64:
      value = std::bit_cast<double>(bits);
      break;
  }
  return value * scale + offset;
}

bool DbcSignal::pack(std::span<std::uint8_t> data, double value) const {
  const double unscaled = (value - offset) / scale;
  bool is_representable = true;
  std::uint64_t bits = 0;
  if (kind == Kind::kFloat64) {
    bits = std::bit_cast<std::uint64_t>(unscaled);
  } else if (kind == Kind::kFloat32) {
    float nearest = 0.0F;
    is_representable = nearest_float(unscaled, nearest);
    bits = std::bit_cast<std::uint32_t>(nearest);
  } else {
    is_representable = nearest_integer(*this, unscaled, bits);
  }
  set_raw(data, bits);
  return is_representable;
}

bool DbcSignal::fits(std::size_t num_bytes) const {
  if (start_bit < 0 || num_bits < 1 || num_bits > 64) return false;
  // Counted from the first bit on the wire for Motorola, from bit 0 for Intel.
  const int first = is_little_endian ? start_bit : start_bit / 8 * 8 + 7 - start_bit % 8;
  const std::size_t bits = num_bytes * 8;
  return static_cast<std::size_t>(start_bit) < bits &&
         static_cast<std::size_t>(first) + static_cast<std::size_t>(num_bits) <= bits;
}

bool DbcSignal::is_selected_by(std::int64_t selector_value) const {
  return std::ranges::any_of(selector_ranges, [&](const auto& range) {
    return range.first <= selector_value && selector_value <= range.second;
  });
}

const DbcSignal* DbcMessage::find(const std::string& signal_name) const {
  for (const DbcSignal& signal : signals) {
    if (signal.name == signal_name) return &signal;
  }
  return nullptr;
}

const DbcSignal* DbcMessage::selector_of(const DbcSignal& signal) const {
  return signal.is_multiplexed() ? &signals[static_cast<std::size_t>(signal.selector)] : nullptr;
}

bool DbcMessage::carries(const DbcSignal& signal, std::span<const std::uint8_t> data) const {
  if (!signal.fits(data.size())) return false;
  const DbcSignal* selected = &signal;
  while (const DbcSignal* selector = selector_of(*selected)) {
    if (!selector->fits(data.size()) || !selected->is_selected_by(value_in(*selector, data)))
      return false;
    selected = selector;
  }
  return true;
}

std::vector<bool> DbcMessage::carried_signals(std::span<const std::uint8_t> data) const {
  std::vector<bool> is_known(signals.size()), is_carried(signals.size());
  std::vector<std::size_t> unknown;  // from a signal up
  for (std::size_t i = 0; i < signals.size(); ++i) {
    unknown.clear();
    for (std::size_t at = i; !is_known[at]; at = static_cast<std::size_t>(signals[at].selector)) {
      is_known[at] = true;
      unknown.push_back(at);
      if (!signals[at].is_multiplexed()) break;
    }
    for (; !unknown.empty(); unknown.pop_back()) {
      const DbcSignal& signal = signals[unknown.back()];
      const DbcSignal* selector = selector_of(signal);
      is_carried[unknown.back()] =
          signal.fits(data.size()) &&
          (selector == nullptr || (is_carried[static_cast<std::size_t>(signal.selector)] &&
                                   signal.is_selected_by(value_in(*selector, data))));
    }
  }
  return is_carried;
}

CanFrame DbcMessage::empty_frame() const {
  CanFrame frame;
  frame.identifier = identifier;
  if (is_extended) frame.flags |= CanFrame::kExtended;
  if (is_fd) frame.flags |= CanFrame::kFd;
  frame.num_bytes = is_fd ? fd_length(num_bytes) : num_bytes;
  return frame;
}

std::optional<CanFrame> DbcMessage::frame_for(const std::vector<DbcSignal>& wanted) const {
  std::map<const DbcSignal*, std::vector<const DbcSignal*>> selected_by;
  for (const DbcSignal& signal : wanted) {
    const DbcSignal* selected = &signal;
    while (const DbcSignal* selector = selector_of(*selected)) {
      selected_by[selector].push_back(selected);
      selected = selector;
    }
  }
  CanFrame frame = empty_frame();
  for (const auto& [selector, selected] : selected_by)
    set_selector(*selector, selected, {frame.data.data(), frame.num_bytes});
  const bool carries_all = std::ranges::all_of(
      wanted, [&](const DbcSignal& signal) { return carries(signal, frame.bytes()); });
  return carries_all ? std::optional(frame) : std::nullopt;
}

bool DbcMessage::matches(const CanFrame& frame) const {
  return frame.identifier == identifier && frame.has(CanFrame::kExtended) == is_extended &&
         !frame.has(CanFrame::kRemote) && !frame.has(CanFrame::kError) &&
         frame.has(CanFrame::kFd) == is_fd &&
         frame.num_bytes == (is_fd ? fd_length(num_bytes) : num_bytes);
}

const DbcMessage* Dbc::find(const std::string& name) const {
  for (const DbcMessage& message : messages) {
    if (message.name == name) return &message;
  }
  return nullptr;
}

const DbcMessage* Dbc::find(std::uint32_t identifier, bool is_extended) const {
  for (const DbcMessage& message : messages) {
    if (message.identifier == identifier && message.is_extended == is_extended) return &message;
  }
  return nullptr;
}

std::string utf8_text(std::string_view text) {
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  std::size_t valid = 0;
  while (valid < text.size()) {
    const std::size_t length = utf8_sequence(text.substr(valid));
    if (length == 0) break;
    valid += length;
  }
  if (valid == text.size()) return std::string(text);
  std::string converted;
  converted.reserve(text.size() + text.size() / 8);
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    append_utf8(converted, byte >= 0x80 && byte < 0xA0 ? kWindows1252[byte - 0x80U] : byte);
  }
  return converted;
}

}  // namespace holdfast
