#include "tools/campaign/stop_signals.h"

#include <sys/signalfd.h>
#include <unistd.h>

#include <csignal>

#include "common/errors.h"

namespace holdfast {

StopSignals::StopSignals() {
  sigset_t wanted;
  sigemptyset(&wanted);
  sigaddset(&wanted, SIGINT);
  sigaddset(&wanted, SIGTERM);
  sigprocmask(SIG_BLOCK, &wanted, nullptr);
  signals_ = FileDescriptor(signalfd(-1, &wanted, SFD_NONBLOCK | SFD_CLOEXEC));
  if (!signals_.is_open()) throw JobError("signals cannot be taken");
}

bool StopSignals::has_come() {
  signalfd_siginfo info;
  has_come_ = has_come_ || read(signals_.get(), &info, sizeof info) == sizeof info;
  return has_come_;
}

}  // namespace holdfast
