#include "drivers/can/frame_protection.h"

#include "drivers/can/frame_codec.h"
#include "drivers/measurement_assembler.h"
#include "tests/support/catch.h"
#include "tests/support/texts.h"

namespace holdfast {
namespace {

using Kind = FrameProtection::Kind;
using Bytes = std::vector<std::uint8_t>;

FrameProtection protection_of(Kind kind, int data_id = 0, int checksum_at = 0) {
  FrameProtection protection;
  protection.kind = kind;
  protection.data_id = data_id;
  protection.checksum_at = checksum_at;
  for (int i = 1; i <= 16; ++i) protection.data_ids.push_back(static_cast<std::uint8_t>(i));
  return protection;
}

Bytes sealed(const FrameProtection& protection, Bytes data, std::int64_t step) {
  protection.set_counter(data, step);
  protection.seal(data);
  return data;
}

const char* const kNetwork =
    "network:\n  messages: [Pose]\n  counter_signal: STEP\n  dbc_text: |\n"
    "    BO_ 16 Pose: 8 A\n"
    "     SG_ X : 16|16@1- (1,0) [0|0] \"m\" M\n"
    "     SG_ HIGH : 12|4@1+ (1,0) [0|0] \"\" M\n"
    "     SG_ LOW : 8|4@1+ (1,0) [0|0] \"\" M\n"
    "     SG_ STEP : 32|16@1+ (1,0) [0|0] \"\" M\n"
    "    BO_ 2032 StepTick: 4 A\n     SG_ STEP : 0|32@1+ (1,0) [0|0] \"\" M\n";

FrameLayout layout_of(const std::string& signals, const std::string& protection,
                      std::string* problems = nullptr) {
  ConfigurationDocument document = ConfigurationDocument::from_text(
      kNetwork + ("  signals: " + signals + "\n  protection: [" + protection + "]\n"), "s.yaml");
  FrameLayout layout;
  layout.read(document.root().map("network"), "");
  try {
    document.finish();
  } catch (const ConfigurationError& error) {
    if (problems == nullptr) throw;
    *problems = error.what();
  }
  return layout;
}

}  // namespace

TEST_CASE("checksums have the published values") {
  // The catalogued check value of CRC-8 SAE J1850 is that of the digits 1 to 9.
  const Bytes digits = {'1', '2', '3', '4', '5', '6', '7', '8', '9', 0};
  CHECK(sealed(protection_of(Kind::kCrc8J1850, 0, 9), digits, 0).back() == 0x4B);
  CHECK(sealed(protection_of(Kind::kXor, 0, 2), {0x0F, 0xF0, 9, 0x11}, 0) ==
        Bytes{0x0F, 0xF0, 0x0F ^ 0xF0 ^ 0x11, 0x11});
  // Examples of the AUTOSAR specification: eight bytes of zero.
  CHECK(sealed(protection_of(Kind::kE2eProfile1, 0x123), Bytes(8, 0), 0) ==
        Bytes{0xCC, 0, 0, 0, 0, 0, 0, 0});
  CHECK(sealed(protection_of(Kind::kE2eProfile2), Bytes(8, 0), 1)[0] == 0x1B);
  CHECK(sealed(protection_of(Kind::kE2eProfile5, 0x1234), Bytes(8, 0), 0) ==
        Bytes{0x1C, 0xCA, 0, 0, 0, 0, 0, 0});
}

TEST_CASE("counters go round as each profile's do, and touch nothing else") {
  for (std::int64_t step = 0; step < 600; ++step) {
    const auto n = static_cast<std::uint64_t>(step);
    CHECK(sealed(protection_of(Kind::kE2eProfile1), Bytes(8, 0xF0), step)[1] == (0xF0 | n % 15));
    CHECK(sealed(protection_of(Kind::kE2eProfile2), Bytes(8, 0x50), step)[1] == (0x50 | n % 16));
    CHECK(sealed(protection_of(Kind::kE2eProfile5, 1, 3), Bytes(8, 0), step)[5] == n % 256);
    CHECK(sealed(protection_of(Kind::kXor, 0, 7), Bytes(8, 7), step)[1] == 7);
  }
}

TEST_CASE("whatever bit is flipped, the checksum does not fit any more") {
  for (const FrameProtection& protection :
       {protection_of(Kind::kXor, 0, 5), protection_of(Kind::kCrc8J1850, 0, 7),
        protection_of(Kind::kE2eProfile1, 0xABC), protection_of(Kind::kE2eProfile2),
        protection_of(Kind::kE2eProfile5, 77, 4)}) {
    const Bytes good = sealed(protection, {9, 8, 7, 6, 5, 4, 3, 2}, 11);
    CHECK(protection.is_sound(good));
    for (std::size_t bit = 0; bit < 64; ++bit) {
      Bytes bad = good;
      bad[bit / 8] = static_cast<std::uint8_t>(bad[bit / 8] ^ (1U << bit % 8));
      // A changed counter of profile 2 takes another data id, so that one in 256 may still fit.
      const bool is_counter = protection.kind == Kind::kE2eProfile2 && bit / 4 == 2;
      if (!is_counter) CHECK_FALSE(protection.is_sound(bad));
    }
  }
  // Another sender's data id is another checksum.
  const Bytes good = sealed(protection_of(Kind::kE2eProfile1, 1), Bytes(8, 3), 2);
  CHECK_FALSE(protection_of(Kind::kE2eProfile1, 2).is_sound(good));
}

TEST_CASE(
    "a protected reading is sealed by who sends it and refused, counted, where it is broken") {
  const FrameLayout layout = layout_of("[X]", "{message: Pose, kind: e2e_p1, data_id: 7}");
  const FrameCodec codec(layout);
  MeasurementAssembler assembler(codec, {});
  const std::vector<double> value = {-300.0};
  CanFrame frame = codec.encode(0, value, 1);
  CHECK(frame.data[1] == 1);
  assembler.on_frame(frame);
  CHECK(assembler.counters().packets == 1);
  frame.data[2] ^= 1;
  assembler.on_frame(frame);
  CHECK(assembler.counters().packets == 1);
  CHECK(assembler.counters().wrong_checksum == 1);
}

TEST_CASE("protection that cannot be is refused with its reason") {
  const auto says = [](const std::string& signals, const std::string& protection,
                       const std::string& text) {
    std::string problems;
    layout_of(signals, protection, &problems);
    testing::check_mentions(problems, text);
  };
  says("[X]", "{message: Pose}", "kind: missing");
  says("[X]", "{message: None, kind: e2e_p1, data_id: 1}", "'None' is no message");
  says("[X]", "{message: Pose, kind: crc8_j1850, checksum_at: 8}", "needs 9 bytes");
  says("[X]", "{message: Pose, kind: e2e_p5, checksum_at: 6, data_id: 1}", "needs 9 bytes");
  says("[X]", "{message: Pose, kind: e2e_p2, data_ids: [1, 2]}", "data_ids");
  says("[X]", "{message: Pose, kind: e2e_p1}", "data_id: missing");
  says("[X]", "{message: StepTick, kind: xor, checksum_at: 0}", "none of the network's messages");
  says(
      "[X]",
      "{message: Pose, kind: e2e_p2, data_ids: [0.5, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1]}",
      "whole numbers");
  says("[X]", "{message: Pose, kind: xor, checksum_at: 3}", "shares bits");
  says("[LOW]", "{message: Pose, kind: e2e_p1, data_id: 1}", "shares bits");
  says("[X]",
       "{message: Pose, kind: xor, checksum_at: 7}, {message: Pose, kind: xor, checksum_at: 6}",
       "protected twice");
  std::string problems;
  layout_of("[X, HIGH]", "{message: Pose, kind: e2e_p1, data_id: 1}", &problems);
  CHECK(problems.empty());
}

}  // namespace holdfast
