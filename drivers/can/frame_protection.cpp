#include "drivers/can/frame_protection.h"

#include <algorithm>
#include <boost/crc.hpp>
#include <cmath>
#include <set>

namespace holdfast {
namespace {

using Kind = FrameProtection::Kind;

constexpr std::size_t kNumDataIds = 16;

// All bytes but those of the checksum.
template <class Crc>
void take_others(Crc& crc, std::span<const std::uint8_t> data, std::size_t at, std::size_t count) {
  crc.process_bytes(data.data(), at);
  crc.process_bytes(data.data() + at + count, data.size() - at - count);
}

std::uint8_t low_byte(int value) {
  return static_cast<std::uint8_t>(value & 0xFF);
}

std::uint8_t high_byte(int value) {
  return static_cast<std::uint8_t>(value >> 8 & 0xFF);
}

void read_kind(ConfigurationMap& map, FrameProtection& protection) {
  map.require("kind");
  map.read_choice("kind", protection.kind,
                  {{"xor", Kind::kXor},
                   {"crc8_j1850", Kind::kCrc8J1850},
                   {"e2e_p1", Kind::kE2eProfile1},
                   {"e2e_p2", Kind::kE2eProfile2},
                   {"e2e_p5", Kind::kE2eProfile5}});
  switch (protection.kind) {
    case Kind::kXor:
    case Kind::kCrc8J1850:
      map.require("checksum_at");
      map.read("checksum_at", protection.checksum_at, {0.0, 63.0});
      break;
    case Kind::kE2eProfile1:
      map.require("data_id");
      map.read("data_id", protection.data_id, {0.0, 65535.0});
      break;
    case Kind::kE2eProfile2: {
      std::vector<double> ids(kNumDataIds, 0.0);
      map.require("data_ids");
      map.read("data_ids", ids, kNumDataIds, {0.0, 255.0});
      ids.resize(kNumDataIds, 0.0);
      for (const double id : ids) {
        if (id != std::floor(id)) map.problem("data_ids", "must be whole numbers");
        protection.data_ids.push_back(static_cast<std::uint8_t>(id));
      }
      break;
    }
    case Kind::kE2eProfile5:
      map.require("data_id");
      map.read("data_id", protection.data_id, {0.0, 65535.0});
      map.read("checksum_at", protection.checksum_at, {0.0, 61.0});
      break;
  }
}

}  // namespace

unsigned FrameProtection::checksum(std::span<const std::uint8_t> data) const {
  const auto at = static_cast<std::size_t>(checksum_at);
  switch (kind) {
    case Kind::kXor: {
      unsigned sum = 0;
      for (std::size_t i = 0; i < data.size(); ++i) sum ^= i == at ? 0U : data[i];
      return sum;
    }
    case Kind::kCrc8J1850: {
      boost::crc_optimal<8, 0x1D, 0xFF, 0xFF, false, false> crc;
      take_others(crc, data, at, 1);
      return crc.checksum();
    }
    case Kind::kE2eProfile1: {
      boost::crc_optimal<8, 0x1D, 0, 0, false, false> crc;
      crc.process_byte(low_byte(data_id));
      crc.process_byte(high_byte(data_id));
      take_others(crc, data, at, 1);
      return crc.checksum();
    }
    case Kind::kE2eProfile2: {
      boost::crc_optimal<8, 0x2F, 0xFF, 0xFF, false, false> crc;
      take_others(crc, data, at, 1);
      crc.process_byte(data_ids[data[1] & 0x0FU]);
      return crc.checksum();
    }
    case Kind::kE2eProfile5: {
      boost::crc_optimal<16, 0x1021, 0xFFFF, 0, false, false> crc;
      take_others(crc, data, at, 2);
      crc.process_byte(low_byte(data_id));
      crc.process_byte(high_byte(data_id));
      return crc.checksum();
    }
  }
  return 0;
}

void FrameProtection::set_counter(std::span<std::uint8_t> data, std::int64_t step) const {
  const auto nibble = [&data](std::int64_t counter) {
    data[1] = static_cast<std::uint8_t>((data[1] & 0xF0) | counter);
  };
  const auto modulo = [step](std::int64_t n) { return (step % n + n) % n; };
  if (kind == Kind::kE2eProfile1) nibble(modulo(15));
  if (kind == Kind::kE2eProfile2) nibble(modulo(16));
  if (kind == Kind::kE2eProfile5)
    data[static_cast<std::size_t>(checksum_at) + 2] = static_cast<std::uint8_t>(modulo(256));
}

void FrameProtection::seal(std::span<std::uint8_t> data) const {
  const unsigned sum = checksum(data);
  const auto at = static_cast<std::size_t>(checksum_at);
  data[at] = static_cast<std::uint8_t>(sum & 0xFF);
  if (checksum_bytes() == 2) data[at + 1] = static_cast<std::uint8_t>(sum >> 8);
}

bool FrameProtection::is_sound(std::span<const std::uint8_t> data) const {
  const auto at = static_cast<std::size_t>(checksum_at);
  const unsigned written =
      data[at] | (checksum_bytes() == 2 ? static_cast<unsigned>(data[at + 1]) << 8 : 0U);
  return written == checksum(data);
}

std::vector<std::uint8_t> FrameProtection::mask(std::size_t num_bytes) const {
  std::vector<std::uint8_t> bits(num_bytes, 0);
  const auto at = static_cast<std::size_t>(checksum_at);
  for (std::size_t i = 0; i < checksum_bytes(); ++i) bits[at + i] = 0xFF;
  if (kind == Kind::kE2eProfile1 || kind == Kind::kE2eProfile2) bits[1] = 0x0F;
  if (kind == Kind::kE2eProfile5) bits[at + 2] = 0xFF;
  return bits;
}

std::vector<FrameProtection> read_protection(ConfigurationMap& map, const Dbc& dbc,
                                             const std::vector<std::string>& readings) {
  std::vector<FrameProtection> list;
  std::set<std::string> seen;
  for (ConfigurationMap& entry : map.maps("protection")) {
    FrameProtection protection;
    entry.require("message");
    entry.read("message", protection.message);
    read_kind(entry, protection);
    if (!entry.has("message")) continue;
    const DbcMessage* message = dbc.find(protection.message);
    if (message == nullptr) {
      entry.problem("message", "'" + protection.message + "' is no message of the DBC");
      continue;
    }
    if (std::find(readings.begin(), readings.end(), protection.message) == readings.end()) {
      entry.problem("message", "'" + protection.message + "' is none of the network's messages");
      continue;
    }
    if (!seen.insert(protection.message).second)
      entry.problem("message", "'" + protection.message + "' is protected twice");
    constexpr std::size_t kCounterBytes = 1;
    const bool has_counter = protection.kind != Kind::kXor && protection.kind != Kind::kCrc8J1850;
    const std::size_t needed = static_cast<std::size_t>(protection.checksum_at) + 1 +
                               (protection.kind == Kind::kE2eProfile5 ? 1 : 0) +
                               (has_counter ? kCounterBytes : 0);
    if (needed > message->num_bytes) {
      entry.problem("kind", "needs " + std::to_string(needed) + " bytes, message '" +
                                message->name + "' has " + std::to_string(message->num_bytes));
      continue;
    }
    list.push_back(std::move(protection));
  }
  return list;
}

}  // namespace holdfast
