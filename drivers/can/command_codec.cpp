#include "drivers/can/command_codec.h"

namespace holdfast {
CommandCodec::CommandCodec(const FrameLayout& layout) {
  if (!layout.command.exists()) return;
  message_ = require_message(layout.dbc, layout.command.message);
  mode_ = require_signal(*message_, layout.command.mode_signal);
  step_ = require_signal(*message_, layout.command.step_signal);
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
