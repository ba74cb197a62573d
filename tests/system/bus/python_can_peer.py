"""Prints each frame that it receives on a python-can udp_multicast bus, and sends it back.

usage: python_can_peer.py GROUP PORT NUM_FRAMES
"""
import sys

import can

FIELDS = ("arbitration_id", "is_extended_id", "is_remote_frame", "is_fd", "bitrate_switch",
          "error_state_indicator", "dlc")


def main():
    group, port, num_frames = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    sent = []
    with can.Bus(channel=group, port=port, interface="udp_multicast", fd=True) as bus:
        print("ready", flush=True)
        while num_frames > 0:
            message = bus.recv(30.0)
            if message is None:
                sys.exit("no frame came")
            values = {field: getattr(message, field) for field in FIELDS}
            key = (tuple(values.values()), bytes(message.data))
            if key in sent:  # its own, which multicast brings back
                sent.remove(key)
                continue
            print(" ".join(str(int(value)) for value in values.values()), message.data.hex() or "-",
                  flush=True)
            sent.append(key)
            bus.send(can.Message(data=None if message.is_remote_frame else message.data, check=True,
                                 **values))
            num_frames -= 1


main()
