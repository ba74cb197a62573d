#pragma once

#include "drivers/file_descriptor.h"

namespace holdfast {

/// Takes SIGINT and SIGTERM of this process, so that a long job may end in order. To be made before
/// any thread, which would take them otherwise.
class StopSignals {
 public:
  StopSignals();
  /// True once one of them has come.
  bool has_come();

 private:
  FileDescriptor signals_;
  bool has_come_ = false;
};

}  // namespace holdfast
