#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <random>

#include "drivers/can/dbc.h"
#include "tests/support/catch.h"

namespace holdfast {
namespace {

using SignalKind = DbcSignal::Kind;
using Data = std::array<std::uint8_t, 64>;

DbcSignal make_signal(int start, int bits, bool is_little_endian, SignalKind kind,
                      double scale = 1.0, double offset = 0.0) {
  DbcSignal signal;
  signal.start_bit = start;
  signal.num_bits = bits;
  signal.is_little_endian = is_little_endian;
  signal.kind = kind;
  signal.scale = scale;
  signal.offset = offset;
  return signal;
}

// Second route: the DBC rule bit by bit. Positions from the most significant bit down.
std::vector<int> bits_from_the_top(const DbcSignal& signal) {
  std::vector<int> positions;
  if (signal.is_little_endian) {
    for (int i = signal.num_bits - 1; i >= 0; --i) positions.push_back(signal.start_bit + i);
    return positions;
  }
  int position = signal.start_bit;
  for (int i = 0; i < signal.num_bits; ++i) {
    positions.push_back(position);
    position = position % 8 == 0 ? position + 15 : position - 1;
  }
  return positions;
}

std::uint64_t raw_by_bits(const DbcSignal& signal, const Data& data) {
  std::uint64_t raw = 0;
  for (const int position : bits_from_the_top(signal)) {
    raw = (raw << 1) | ((data[static_cast<std::size_t>(position / 8)] >> (position % 8)) & 1U);
  }
  return raw;
}

TEST_CASE("the known vector: Intel, Motorola and float in one message") {
  const std::array<std::uint8_t, 8> data = {0xF2, 0x34, 0x12, 0x00, 0x00, 0x00, 0x80, 0xBF};
  CHECK(make_signal(8, 16, true, SignalKind::kUnsigned).unpack(data) == 4660.0);
  CHECK(make_signal(7, 12, false, SignalKind::kSigned).unpack(data) == -221.0);
  CHECK(make_signal(32, 32, true, SignalKind::kFloat32).unpack(data) == -1.0);
}

TEST_CASE("hand-written bytes of packed values") {
  std::array<std::uint8_t, 8> data{};
  CHECK(make_signal(8, 16, true, SignalKind::kUnsigned).pack(data, 4660.0));
  CHECK(make_signal(32, 32, true, SignalKind::kFloat32).pack(data, -1.0));
  CHECK(make_signal(7, 8, false, SignalKind::kUnsigned).pack(data, 0xF2));
  CHECK(data == std::array<std::uint8_t, 8>{0xF2, 0x34, 0x12, 0, 0, 0, 0x80, 0xBF});

  data = {};
  CHECK(make_signal(2, 5, false, SignalKind::kUnsigned)
            .pack(data, 0b10110));  // 101 | 10 over a byte's end
  CHECK(data[0] == 0b00000101);
  CHECK(data[1] == 0b10000000);

  data = {};
  CHECK(make_signal(7, 64, false, SignalKind::kFloat64).pack(data, 1.0));
  CHECK(data == std::array<std::uint8_t, 8>{0x3F, 0xF0, 0, 0, 0, 0, 0, 0});
}

TEST_CASE("scale and offset, and rounding to the nearest raw value") {
  std::array<std::uint8_t, 2> data{};
  const DbcSignal signal = make_signal(0, 12, true, SignalKind::kSigned, 0.25, -3.0);
  CHECK(signal.pack(data, 7.0));
  CHECK(data[0] == 40);
  CHECK(signal.unpack(data) == 7.0);
  CHECK(signal.pack(data, 7.12));  // 40.48
  CHECK(signal.unpack(data) == 7.0);
  CHECK(signal.pack(data, 7.125));  // 40.5: away from zero
  CHECK(signal.unpack(data) == 7.25);
  const DbcSignal falling = make_signal(0, 8, true, SignalKind::kUnsigned, -2.0, 10.0);
  CHECK(falling.pack(data, 0.0));
  CHECK(data[0] == 5);
}

TEST_CASE("integers saturate at the ends of the raw range and say so") {
  std::array<std::uint8_t, 8> data{};
  const double infinity = std::numeric_limits<double>::infinity();
  for (int bits = 1; bits <= 64; ++bits) {
    const DbcSignal plain = make_signal(0, bits, true, SignalKind::kUnsigned);
    const std::uint64_t all = ~std::uint64_t{0} >> (64 - bits);
    CHECK_FALSE(plain.pack(data, infinity));
    CHECK(plain.raw(data) == all);
    CHECK_FALSE(plain.pack(data, std::ldexp(1.0, bits)));
    CHECK(plain.raw(data) == all);
    CHECK_FALSE(plain.pack(data, -1.0));
    CHECK(plain.raw(data) == 0);
    CHECK(plain.pack(data, 0.0));
    CHECK(plain.pack(data, 1.0));
    CHECK(plain.raw(data) == 1);

    const DbcSignal with_sign = make_signal(0, bits, true, SignalKind::kSigned);
    const std::int64_t highest = static_cast<std::int64_t>(all >> 1);
    CHECK_FALSE(with_sign.pack(data, std::ldexp(1.0, bits - 1)));
    CHECK(static_cast<std::int64_t>(with_sign.raw(data)) == highest);
    CHECK(with_sign.pack(data, -std::ldexp(1.0, bits - 1)));
    CHECK(static_cast<std::int64_t>(with_sign.raw(data)) == -highest - 1);
    CHECK_FALSE(with_sign.pack(data, -infinity));
    CHECK(static_cast<std::int64_t>(with_sign.raw(data)) == -highest - 1);
  }
  const DbcSignal byte = make_signal(0, 8, true, SignalKind::kUnsigned);
  CHECK(byte.pack(data, 255.4));
  CHECK_FALSE(byte.pack(data, 255.5));
  CHECK(byte.raw(data) == 255);
  CHECK(byte.pack(data, -0.4));
  CHECK_FALSE(byte.pack(data, std::nan("")));
  CHECK(byte.raw(data) == 0);
}

TEST_CASE("floats carry NaN and infinity, and finite values saturate") {
  std::array<std::uint8_t, 8> data{};
  const double infinity = std::numeric_limits<double>::infinity();
  const double float_max = std::numeric_limits<float>::max();
  const DbcSignal single = make_signal(7, 32, false, SignalKind::kFloat32);
  const DbcSignal twice = make_signal(0, 64, true, SignalKind::kFloat64);
  for (const DbcSignal& signal : {single, twice}) {
    CHECK(signal.pack(data, std::nan("")));
    CHECK(std::isnan(signal.unpack(data)));
    CHECK(signal.pack(data, -infinity));
    CHECK(signal.unpack(data) == -infinity);
  }
  CHECK_FALSE(single.pack(data, 1e39));
  CHECK(single.unpack(data) == float_max);
  CHECK_FALSE(single.pack(data, -1e300));
  CHECK(single.unpack(data) == -float_max);
  CHECK(single.pack(data, 0.1));
  CHECK(single.unpack(data) == static_cast<double>(0.1F));
  CHECK(twice.pack(data, 1e300));
  CHECK(twice.unpack(data) == 1e300);
}

TEST_CASE("raw and set_raw follow the bit rule for random layouts and touch no other bit") {
  std::mt19937 generator(1);
  int num_checked = 0;
  for (int round = 0; round < 4000; ++round) {
    const int start = static_cast<int>(generator() % 512U);
    const int bits = 1 + static_cast<int>(generator() % 64U);
    const DbcSignal signal =
        make_signal(start, bits, generator() % 2U == 0,
                    generator() % 2U == 0 ? SignalKind::kUnsigned : SignalKind::kSigned);
    const std::vector<int> positions = bits_from_the_top(signal);
    const int last = *std::max_element(positions.begin(), positions.end());
    // fits() by the second route: all positions inside, for every length.
    for (const std::size_t num_bytes : {0U, 1U, 8U, 48U, 64U}) {
      CHECK(signal.fits(num_bytes) == (last < static_cast<int>(num_bytes * 8)));
    }
    if (last >= 512) continue;
    ++num_checked;
    Data data;
    for (std::uint8_t& byte : data) byte = static_cast<std::uint8_t>(generator());
    const std::uint64_t mask = ~std::uint64_t{0} >> (64 - bits);
    std::uint64_t expected = raw_by_bits(signal, data);
    if (signal.kind == SignalKind::kSigned && (expected >> (bits - 1)) != 0) expected |= ~mask;
    REQUIRE(signal.raw(data) == expected);

    const std::uint64_t written = (static_cast<std::uint64_t>(generator()) << 32) | generator();
    Data changed = data;
    signal.set_raw(changed, written);
    REQUIRE(raw_by_bits(signal, changed) == (written & mask));
    signal.set_raw(changed, expected);
    REQUIRE(changed == data);
  }
  CHECK(num_checked > 3000);
}

TEST_CASE("fits refuses impossible numbers") {
  CHECK_FALSE(make_signal(-1, 1, true, SignalKind::kUnsigned).fits(8));
  CHECK_FALSE(make_signal(0, 0, true, SignalKind::kUnsigned).fits(8));
  CHECK_FALSE(make_signal(0, 65, true, SignalKind::kUnsigned).fits(64));
  CHECK(make_signal(7, 64, false, SignalKind::kUnsigned).fits(8));
  CHECK_FALSE(make_signal(6, 64, false, SignalKind::kUnsigned).fits(8));
}

}  // namespace
}  // namespace holdfast
