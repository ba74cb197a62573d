"""One-way bridge by python-can's own means: a Notifier that hands each frame to the other bus."""

import signal
import sys

import can


def main() -> None:
    source = can.Bus(interface="socketcan", channel=sys.argv[1], fd=True)
    target = can.Bus(interface="socketcan", channel=sys.argv[2], fd=True)
    notifier = can.Notifier([source], [can.RedirectReader(target)])
    signal.sigwait([signal.SIGTERM, signal.SIGINT])
    notifier.stop(timeout=0.1)


if __name__ == "__main__":
    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGTERM, signal.SIGINT])
    main()
