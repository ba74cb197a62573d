// libFuzzer target: whatever the guard lets through must decode within its bytes and encode to the
// same ones; whatever it refuses must cost no memory. The first byte picks the type, whose
// fingerprint is put in front, so that the fuzzer need not guess 64 bits.

#include <cstdlib>

#include "common/lcm_guard.h"
#include "tests/support/message_types.h"

namespace {

template <class Message>
void check(std::span<const std::uint8_t> fields) {
  std::vector<std::uint8_t> bytes;
  const auto hash = static_cast<std::uint64_t>(Message::getHash());
  for (int i = 7; i >= 0; --i) bytes.push_back(static_cast<std::uint8_t>(hash >> (8 * i)));
  bytes.insert(bytes.end(), fields.begin(), fields.end());
  const auto& layout = *holdfast::layouts::of<Message>;
  if (holdfast::check_wire(layout, Message::getHash(), bytes) != holdfast::GuardVerdict::kOk)
    return;
  Message message;
  const int size = static_cast<int>(bytes.size());
  if (message.decode(bytes.data(), 0, size) != size) std::abort();
  if (holdfast::testing::encoded(message) != bytes) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::span<const std::uint8_t> input(data, size);
  int wanted = 0, index = 0;
  holdfast::testing::for_each_message_type([&]<class Message>() { ++wanted; });
  wanted = data[0] % wanted;
  holdfast::testing::for_each_message_type([&]<class Message>() {
    if (index++ == wanted) check<Message>(input.subspan(1));
  });
  return 0;
}
