#include "tests/fuzz/support.h"

#include <algorithm>
#include <cstdlib>

namespace holdfast::fuzzing {

void must(bool holds) {
  if (!holds) std::abort();
}

std::span<const std::uint8_t> Input::take_bytes(std::size_t size) {
  const std::span<const std::uint8_t> taken = rest_.first(std::min(size, rest_.size()));
  rest_ = rest_.subspan(taken.size());
  return taken;
}

CanFrame Input::take_frame() {
  CanFrame frame;
  frame.flags = take<std::uint8_t>() & 0x3FU & ~std::uint8_t{CanFrame::kError};
  frame.identifier =
      take<std::uint32_t>() & (frame.has(CanFrame::kExtended) ? 0x1FFFFFFFU : 0x7FFU);
  constexpr std::uint8_t kFdOnly =
      CanFrame::kFd | CanFrame::kBitRateSwitch | CanFrame::kErrorStateIndicator;
  if (frame.has(CanFrame::kRemote) || !frame.has(CanFrame::kFd))
    frame.flags = static_cast<std::uint8_t>(frame.flags & ~kFdOnly);
  const std::size_t num_lengths = frame.has(CanFrame::kFd) ? kFrameLengths.size() : 9;
  frame.num_bytes = kFrameLengths[below(num_lengths)];
  std::ranges::copy(take_bytes(frame.bytes().size()), frame.data.begin());
  frame.receive_time_ns = take<std::uint16_t>();
  must(is_valid(frame));
  return frame;
}

std::optional<FrameLayout> read_layout(const std::string& text) {
  FrameLayout layout;
  try {
    ConfigurationDocument document = ConfigurationDocument::from_text(text, "layout");
    layout.read(document.root(), "");
    document.finish();
  } catch (const UsageError&) {
    return std::nullopt;
  }
  return layout;
}

FrameLayout layout_of(const std::string& name) {
  FrameLayout layout;
  ConfigurationDocument document =
      ConfigurationDocument::from_file(HOLDFAST_SOURCE_DIR "/tests/fuzz/layouts/" + name + ".yaml");
  layout.read(document.root(), "");
  document.finish();
  layout.command.mode_names = {"closed", "open"};
  return layout;
}

std::vector<std::vector<CanFrame>> frames_of_steps(const FrameLayout& layout,
                                                   std::size_t num_steps) {
  const FrameCodec codec(layout);
  std::vector<std::vector<CanFrame>> steps(num_steps);
  std::uint64_t state = 1;
  const auto next = [&state] {
    state = state * 6364136223846793005U + 1442695040888963407U;
    return static_cast<std::uint8_t>(state >> 56U);
  };
  for (std::vector<CanFrame>& frames : steps) {
    for (const DbcMessage& message : layout.dbc.messages) {
      if (message.name == layout.tick_message) continue;
      CanFrame frame = message.empty_frame();
      for (std::uint8_t& byte : frame.data) byte = next();
      frames.push_back(frame);
      if (message.is_fd) continue;
      frame.num_bytes = next() % 9U;
      frames.push_back(frame);
      frame.flags |= CanFrame::kRemote;
      frames.push_back(frame);
    }
    frames.push_back(codec.encode_tick(1 + (&frames - steps.data())));
  }
  return steps;
}

}  // namespace holdfast::fuzzing
