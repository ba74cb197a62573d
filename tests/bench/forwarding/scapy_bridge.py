"""One-way bridge by scapy's own means: bridge_and_sniff between two native CAN sockets, frames unchanged."""

import os
import signal
import sys

from scapy.config import conf

conf.contribs["CANSocket"] = {"use-python-can": False}
from scapy.contrib.cansocket_native import NativeCANSocket  # noqa: E402  the choice above comes first
from scapy.sendrecv import bridge_and_sniff  # noqa: E402


def main() -> None:
    signal.signal(signal.SIGTERM, lambda *_: os._exit(0))
    source, target = (NativeCANSocket(channel=name) for name in sys.argv[1:3])
    bridge_and_sniff(source, target, xfrm12=lambda packet: packet, xfrm21=lambda packet: False, store=False, count=0)


if __name__ == "__main__":
    main()
