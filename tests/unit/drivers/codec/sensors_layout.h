#pragma once

#include "drivers/can/frame_codec.h"

namespace holdfast {

/// Three sensors with a bit and an 8-bit counter, one with two floats and the counter (FD), a tick
/// of 16 bits. Small counters, so that tests see them wrap.
inline FrameLayout small_layout() {
  FrameLayout layout;
  layout.dbc = parse_dbc(
      "BO_ 257 One: 3 A\n SG_ BIT : 0|1@1+ (1,0) [0|1] \"\" M\n SG_ STEP : 8|8@1+ (1,0) [0|0] \"\" "
      "M\n"
      "BO_ 258 Two: 3 A\n SG_ BIT : 0|1@1+ (1,0) [0|1] \"\" M\n SG_ STEP : 8|8@1+ (1,0) [0|0] \"\" "
      "M\n"
      "BO_ 2147483907 Three: 3 A\n SG_ BIT : 7|1@0+ (1,0) [0|1] \"\" M\n SG_ STEP : 15|8@0+ (1,0) "
      "[0|0] \"\" M\n"
      "BO_ 2032 StepTick: 4 A\n SG_ STEP : 0|16@1+ (1,0) [0|0] \"\" M\n");
  layout.messages = {"One", "Two", "Three"};
  layout.signals = {"BIT"};
  layout.counter_signal = "STEP";
  return layout;
}

/// One FD message with two floats, no counter.
inline FrameLayout float_layout() {
  FrameLayout layout;
  layout.dbc = parse_dbc(
      "BO_ 16 Pose: 12 A\n SG_ X : 0|32@1- (1,0) [0|0] \"m\" M\n SG_ Y : 39|64@0- (1,0) [0|0] "
      "\"m\" M\n"
      "BO_ 2032 StepTick: 4 A\n SG_ STEP : 0|32@1+ (1,0) [0|0] \"\" M\n"
      "SIG_VALTYPE_ 16 X : 1;\nSIG_VALTYPE_ 16 Y : 2;\n");
  layout.messages = {"Pose"};
  layout.signals = {"Y", "X"};
  return layout;
}

}  // namespace holdfast
