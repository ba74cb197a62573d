#pragma once

// Bodies of LcmLink's templates; included by lcm_link.h only.

#include <holdfast/layouts.h>

#include "common/lcm_link.h"

namespace holdfast {

template <class Message>
void LcmLink::subscribe(const std::string& channel, std::function<void(const Message&)> handler) {
  static_assert(layouts::has<Message>, "not a type of lcmtypes/");
  // The decoded message lives with the subscription, so that its vectors keep their memory.
  auto message = std::make_shared<Message>();
  subscribe_raw(channel, [this, channel, message,
                          handler = std::move(handler)](std::span<const std::uint8_t> buffer) {
    if (!accept(*layouts::of<Message>, Message::getHash(), buffer)) return;
    message->decode(buffer.data(), 0, static_cast<int>(buffer.size()));
    note_seq(channel, message->seq);
    handler(*message);
  });
}

template <class Message>
bool LcmLink::publish(const std::string& channel, Message& message) {
  message.seq = next_seq_out_[channel]++;
  std::vector<std::uint8_t>& bytes = scratch(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return publish_bytes(channel, bytes.data(), bytes.size());
}

/// Decodes a buffer that may come from anywhere; false when the guard refuses it.
template <class Message>
bool decode_guarded(std::span<const std::uint8_t> buffer, Message& message) {
  if (check_wire(*layouts::of<Message>, Message::getHash(), buffer) != GuardVerdict::kOk)
    return false;
  return message.decode(buffer.data(), 0, static_cast<int>(buffer.size())) >= 0;
}

}  // namespace holdfast
