"""LCM over a plain UDP socket: what a program in Python needs to join a run, without an LCM module.

Wire format of a short message: "LC02", u32 sequence number, channel, NUL, payload; of a fragment: "LC03",
u32 sequence number, u32 message size, u32 offset, u16 fragment number, u16 number of fragments, and the
channel in front of the first fragment's data. All big-endian.
"""
import socket
import struct
import urllib.parse

SHORT_MAGIC = 0x4C433032
FRAGMENT_MAGIC = 0x4C433033
SHORT_BYTES_MAX = 1400
MESSAGES_IN_PIECES_MAX = 64


class LcmSocket:
    """Sends and receives on one LCM URL: udpm://GROUP:PORT?ttl=0."""

    def __init__(self, url, receive_buffer_bytes=4 << 20):
        parts = urllib.parse.urlparse(url)
        if parts.scheme != "udpm" or not parts.hostname or not parts.port:
            raise ValueError(f"{url}: must be udpm://GROUP:PORT?ttl=0")
        options = urllib.parse.parse_qs(parts.query)
        self.address = (parts.hostname, parts.port)
        self.receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.receiver.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer_bytes)
        self.receiver.bind(self.address)
        membership = socket.inet_aton(parts.hostname) + struct.pack("=I", socket.INADDR_ANY)
        self.receiver.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
        self.sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, int(options.get("ttl", ["0"])[0]))
        self.sequence = 0
        self.pieces = {}

    def close(self):
        self.receiver.close()
        self.sender.close()

    def publish(self, channel, payload):
        """Sends bytes of at most SHORT_BYTES_MAX on a channel."""
        datagram = struct.pack(">II", SHORT_MAGIC, self.sequence) + channel.encode() + b"\0" + payload
        if len(datagram) > SHORT_BYTES_MAX:
            raise ValueError(f"{channel}: {len(payload)} bytes do not fit into one datagram")
        self.sequence = (self.sequence + 1) & 0xFFFFFFFF
        self.sender.sendto(datagram, self.address)

    def receive(self, timeout_s=None):
        """Returns (channel, payload) of the next whole message, None after the time-out."""
        self.receiver.settimeout(timeout_s)
        while True:
            try:
                datagram, sender = self.receiver.recvfrom(65536)
            except (socket.timeout, BlockingIOError):
                return None
            message = self._take(datagram, sender)
            if message is not None:
                return message

    def _take(self, datagram, sender):
        if len(datagram) < 8:
            return None
        magic, sequence = struct.unpack(">II", datagram[:8])
        if magic == SHORT_MAGIC:
            channel, separator, payload = datagram[8:].partition(b"\0")
            return (channel.decode(errors="replace"), payload) if separator else None
        if magic != FRAGMENT_MAGIC or len(datagram) < 20:
            return None
        size, offset, number, count = struct.unpack(">IIHH", datagram[8:20])
        data, key = datagram[20:], (sender, sequence)
        channel = None
        if number == 0:
            channel, _, data = data.partition(b"\0")
        whole = self.pieces.setdefault(key, {"channel": None, "data": {}, "size": size})
        whole["channel"] = channel or whole["channel"]
        whole["data"][offset] = data
        while len(self.pieces) > MESSAGES_IN_PIECES_MAX:
            self.pieces.pop(next(iter(self.pieces)))
        if len(whole["data"]) < count or whole["channel"] is None:
            return None
        self.pieces.pop(key, None)
        payload = b"".join(whole["data"][at] for at in sorted(whole["data"]))
        return (whole["channel"].decode(errors="replace"), payload) if len(payload) == size else None
