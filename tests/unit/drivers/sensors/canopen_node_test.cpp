// A CANopen node with digital inputs, as it is heard and as it is played.
#include "drivers/sensors/canopen_node.h"

#include "tests/support/catch.h"

namespace holdfast {
namespace {

BinarySensors options_of() {
  return {};
}

CanFrame heartbeat(int node, std::uint8_t state) {
  return canopen_frame(0x700U + static_cast<std::uint32_t>(node), {state});
}

std::vector<std::uint32_t> identifiers(const std::vector<CanFrame>& frames) {
  std::vector<std::uint32_t> list;
  for (const CanFrame& frame : frames) list.push_back(frame.identifier);
  return list;
}

using Identifiers = std::vector<std::uint32_t>;

}  // namespace

TEST_CASE("a node's inputs are known while it is operational, has told them, and is alive") {
  const BinarySensors options = options_of();
  CanopenRemote node(5);
  CHECK(node.reason(1, 1, options.heeds_emergencies) == InvalidReason::kNeverHeard);
  CHECK_FALSE(node.wants_start(1));
  REQUIRE(node.on_frame(heartbeat(5, 0x00), 2));
  CHECK(node.reason(1, 2, options.heeds_emergencies) == InvalidReason::kNotOperational);
  CHECK(node.wants_start(2));
  CHECK_FALSE(node.wants_start(9));  // nobody is there to be told
  CHECK(node.start_command().same_on_wire(canopen_frame(0x000, {0x01, 0x05})));
  REQUIRE(node.on_frame(heartbeat(5, 0x05), 3));
  CHECK_FALSE(node.wants_start(3));
  CHECK(node.reason(1, 3, options.heeds_emergencies) == InvalidReason::kNotAvailable);
  REQUIRE(node.on_frame(canopen_frame(0x185, {0x81, 0x40}), 3));
  CHECK(node.reason(1, 3, options.heeds_emergencies) == InvalidReason::kNone);
  CHECK(node.inputs() == 0x4081);
  // An unchanged state needs no frame, only a sign of life.
  CHECK(node.reason(1, 5, options.heeds_emergencies) == InvalidReason::kNone);
  CHECK(node.reason(1, 6, options.heeds_emergencies) == InvalidReason::kSilent);
  // In time, though only just.
  REQUIRE(node.on_frame(heartbeat(5, 0x05), 6));
  CHECK(node.reason(1, 6, options.heeds_emergencies) == InvalidReason::kNone);
  // Back after a step of silence: what it said before is not what it would say now.
  REQUIRE(node.on_frame(heartbeat(5, 0x05), 10));
  CHECK(node.reason(1, 10, options.heeds_emergencies) == InvalidReason::kNotAvailable);
}

TEST_CASE("an input that a frame is too short for is not known") {
  CanopenRemote node(5);
  node.on_frame(heartbeat(5, 0x05), 1);
  node.on_frame(canopen_frame(0x185, {0xFF}), 1);
  CHECK(node.reason(8, 1, true) == InvalidReason::kNone);
  CHECK(node.reason(9, 1, true) == InvalidReason::kNotAvailable);
  CHECK(node.tells_inputs(canopen_frame(0x185, {0xFF})));
  CHECK_FALSE(node.tells_inputs(heartbeat(5, 0x05)));
}

TEST_CASE("a node that booted anew, stopped or fell back must tell its inputs again") {
  const BinarySensors options = options_of();
  for (const std::uint8_t state : {0x00, 0x04, 0x7F}) {
    CanopenRemote node(1);
    node.on_frame(heartbeat(1, 0x05), 1);
    node.on_frame(canopen_frame(0x181, {0xFF}), 1);
    REQUIRE(node.reason(1, 1, options.heeds_emergencies) == InvalidReason::kNone);
    node.on_frame(heartbeat(1, state), 1);
    CHECK(node.reason(1, 1, options.heeds_emergencies) == InvalidReason::kNotOperational);
    node.on_frame(heartbeat(1, 0x05), 1);
    CHECK(node.reason(1, 1, options.heeds_emergencies) == InvalidReason::kNotAvailable);
  }
}

TEST_CASE("an emergency makes inputs invalid until it is over, unless it is not heeded") {
  BinarySensors options = options_of();
  CanopenRemote node(1);
  node.on_frame(heartbeat(1, 0x05), 1);
  node.on_frame(canopen_frame(0x181, {0x01}), 1);
  REQUIRE(node.on_frame(canopen_frame(0x081, {0x10, 0x31, 0x05, 0, 0, 0, 0, 0}), 1));
  CHECK(node.reason(1, 1, options.heeds_emergencies) == InvalidReason::kError);
  options.heeds_emergencies = false;
  CHECK(node.reason(1, 1, options.heeds_emergencies) == InvalidReason::kNone);
  options.heeds_emergencies = true;
  REQUIRE(node.on_frame(canopen_frame(0x081, {0, 0, 0, 0, 0, 0, 0, 0}), 1));
  CHECK(node.reason(1, 1, options.heeds_emergencies) == InvalidReason::kNone);
}

TEST_CASE("an answer to node guarding is a sign of life, whatever its toggle bit") {
  const BinarySensors options;
  CanopenRemote node(3, 1);
  for (const std::uint8_t state : {0x05, 0x85, 0x05}) {
    REQUIRE(node.on_frame(heartbeat(3, state), 4));
    CHECK(node.reason(1, 4, options.heeds_emergencies) == InvalidReason::kNotAvailable);
  }
  const CanFrame request = node.guard_request();
  CHECK(request.identifier == 0x703);
  CHECK(request.has(CanFrame::kRemote));
  // A request, ours or another's, is no answer.
  CHECK_FALSE(node.sends(request));
}

TEST_CASE("frames of other nodes and of no sound form say nothing") {
  CanopenRemote node(5);
  CHECK_FALSE(node.sends(heartbeat(6, 0x05)));
  CanFrame extended = heartbeat(5, 0x05);
  extended.flags |= CanFrame::kExtended;
  CHECK_FALSE(node.sends(extended));
  CHECK_FALSE(node.on_frame(canopen_frame(0x705, {}), 1));
  CHECK_FALSE(node.on_frame(canopen_frame(0x705, {0x05, 0x05}), 1));
  CHECK_FALSE(node.on_frame(heartbeat(5, 0x33), 1));
  CHECK_FALSE(node.on_frame(heartbeat(5, 0x80), 1));  // boot-up has no toggle bit
  CHECK_FALSE(node.on_frame(canopen_frame(0x185, {}), 1));
  CHECK_FALSE(node.on_frame(canopen_frame(0x085, {1, 2}), 1));
  CHECK(node.reason(1, 1, true) == InvalidReason::kNeverHeard);
}

TEST_CASE("a device boots, lives, and tells its inputs when they change and again after a while") {
  BinarySensors options = options_of();
  options.repeat_steps = 3;
  CanopenDevice device(5, 10, options);
  std::vector<CanFrame> frames;
  const auto sent = [&](std::uint64_t inputs) {
    frames.clear();
    device.step(inputs, false, frames);
    return identifiers(frames);
  };
  CHECK(sent(0x201) == Identifiers{0x705, 0x705, 0x185});
  CHECK(frames[0].data[0] == 0x00);
  CHECK(frames[1].data[0] == 0x05);
  CHECK(frames[2].num_bytes == 2);
  CHECK(frames[2].data[0] == 0x01);
  CHECK(frames[2].data[1] == 0x02);
  CHECK(sent(0x201) == Identifiers{0x705});
  CHECK(sent(0x201) == Identifiers{0x705});
  CHECK(sent(0x201) == Identifiers{0x705, 0x185});
  CHECK(sent(0x200) == Identifiers{0x705, 0x185});
  // Pulled out and put back.
  frames.clear();
  device.step(0x200, true, frames);
  CHECK(frames.empty());
  CHECK(sent(0x200) == Identifiers{0x705, 0x705, 0x185});
}

TEST_CASE("network management is obeyed, by the node that it means") {
  BinarySensors options = options_of();
  options.nodes_start_themselves = false;
  CanopenDevice device(5, 1, options);
  std::vector<CanFrame> frames;
  device.on_frame(canopen_frame(0x000, {0x01, 0x05}));  // it is not there yet
  device.step(1, false, frames);
  CHECK(device.state() == CanopenState::kPreOperational);
  CHECK(identifiers(frames) == Identifiers{0x705, 0x705});
  device.on_frame(canopen_frame(0x000, {0x01, 0x06}));
  device.on_frame(canopen_frame(0x000, {0x01}));
  CHECK(device.state() == CanopenState::kPreOperational);
  device.on_frame(canopen_frame(0x000, {0x01, 0x00}));
  CHECK(device.state() == CanopenState::kOperational);
  frames.clear();
  device.step(1, false, frames);
  CHECK(identifiers(frames) == Identifiers{0x705, 0x185});
  device.on_frame(canopen_frame(0x000, {0x02, 0x05}));
  CHECK(device.state() == CanopenState::kStopped);
  device.on_frame(canopen_frame(0x000, {0x80, 0x05}));
  CHECK(device.state() == CanopenState::kPreOperational);
  device.on_frame(canopen_frame(0x000, {0x81, 0x05}));
  frames.clear();
  device.step(1, false, frames);
  CHECK(frames.at(0).data[0] == 0x00);  // boots anew
}

TEST_CASE("a guarded device answers each request once, its toggle bit changing") {
  BinarySensors options = options_of();
  options.heartbeat_steps = 0;
  CanopenDevice device(5, 1, options);
  CanopenRemote remote(5);
  std::vector<CanFrame> frames;
  device.step(0, false, frames);
  for (const std::uint8_t expected : {0x05, 0x85, 0x05}) {
    device.on_frame(remote.guard_request());
    device.on_frame(remote.guard_request());
    frames.clear();
    device.step(0, false, frames);
    REQUIRE(frames.size() == 1);
    CHECK(frames[0].data[0] == expected);
  }
  device.on_frame(CanopenRemote(6).guard_request());
  frames.clear();
  device.step(0, false, frames);
  CHECK(frames.empty());
}

}  // namespace holdfast
