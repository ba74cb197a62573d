#include "drivers/can/command_codec.h"

#include "common/errors.h"

namespace holdfast {
namespace {

const DbcSignal& needed(const DbcMessage& message, const std::string& name) {
  const DbcSignal* signal = message.find(name);
  if (signal == nullptr) throw UsageError("message " + message.name + " has no signal " + name);
  return *signal;
}

}  // namespace

CommandCodec::CommandCodec(const FrameLayout& layout) {
  if (!layout.command.exists()) return;
  const DbcMessage* message = layout.dbc.find(layout.command.message);
  if (message == nullptr) throw UsageError("the DBC has no message " + layout.command.message);
  message_ = *message;
  mode_ = needed(*message, layout.command.mode_signal);
  step_ = needed(*message, layout.command.step_signal);
}

bool CommandCodec::has_identifier(const CanFrame& frame) const {
  return message_ && frame.identifier == message_->identifier &&
         frame.has(CanFrame::kExtended) == message_->is_extended;
}

CanFrame CommandCodec::encode(const ModeChange& command) const {
  CanFrame frame = message_->empty_frame();
  mode_.set_raw(frame.data, static_cast<std::uint64_t>(command.mode));
  step_.set_raw(frame.data, static_cast<std::uint64_t>(command.from_step));
  return frame;
}

std::optional<ModeChange> CommandCodec::decode(const CanFrame& frame) const {
  if (!message_ || !message_->matches(frame)) return std::nullopt;
  ModeChange command;
  command.mode = static_cast<int>(mode_.raw(frame.bytes()));
  command.from_step = static_cast<std::int64_t>(step_.raw(frame.bytes()));
  return command;
}

}  // namespace holdfast
