#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/mode_change.h"
#include "drivers/can/can_frame.h"
#include "drivers/can/dbc.h"
#include "drivers/can/frame_codec.h"

namespace holdfast {

/// Commands to the plant <-> frames by DBC, on the way back: monitor-side bus, attacker,
/// sensor-side bus, plant. Pure. Of a layout without commands no frame is one.
class CommandCodec {
 public:
  /// Precondition: the layout was read without problems.
  explicit CommandCodec(const FrameLayout& layout);

  /// True for a frame with the command's identifier, well formed or not.
  bool has_identifier(const CanFrame& frame) const;
  /// Precondition: the layout has commands; numbers beyond their signals' range lose high bits.
  CanFrame encode(const ModeChange& command) const;
  /// None for a frame that is no command: identifier, format or length are others.
  std::optional<ModeChange> decode(const CanFrame& frame) const;

 private:
  std::optional<DbcMessage> message_;
  DbcSignal mode_, step_;
};

}  // namespace holdfast
