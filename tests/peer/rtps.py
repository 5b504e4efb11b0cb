"""A peer that speaks RTPS by hand, so that it can send what no library would; little endian, protocol 2.4.

Parts of a message are functions that give its bytes. `Stranger` announces itself and its writers to a node, as any
participant does, and then sends whatever it is given.
"""

import os
import socket
import struct
import time

SPDP_WRITER, SPDP_READER = 0x000100C2, 0x000100C7
SEDP_PUBLICATIONS_WRITER, SEDP_PUBLICATIONS_READER = 0x000003C2, 0x000003C7
SEDP_SUBSCRIPTIONS_WRITER, SEDP_SUBSCRIPTIONS_READER = 0x000004C2, 0x000004C7
MESSAGE_WRITER, MESSAGE_READER = 0x000200C2, 0x000200C7
BUILTIN = ((SEDP_PUBLICATIONS_WRITER, SEDP_PUBLICATIONS_READER), (SEDP_SUBSCRIPTIONS_WRITER, SEDP_SUBSCRIPTIONS_READER))
PARTICIPANT = 0x000001C1
UNKNOWN = 0
# A user's writer without key.
WRITER = 0x00000103
READER = 0x00000104
# All of the standard builtin readers and writers.
ENDPOINTS = 0x00000C3F
MULTICAST = "239.255.0.1"


def ports(domain, participant):
    """Where a participant listens for announcements and for data."""
    return 7400 + 250 * domain + 10 + 2 * participant, 7400 + 250 * domain + 11 + 2 * participant


def header(prefix):
    return b"RTPS" + bytes((2, 4, 1, 15)) + prefix


def entity(number):
    return struct.pack(">I", number)


def sequence(number):
    return struct.pack("<iI", number >> 32, number & 0xFFFFFFFF)


def submessage(kind, flags, body):
    """A submessage; one that is too long for its length field is the last one."""
    length = len(body) if len(body) < 0x10000 else 0
    return struct.pack("<BBH", kind, flags | 1, length) + body


def parameter(pid, value):
    value += bytes(-len(value) % 4)
    return struct.pack("<HH", pid, len(value)) + value


def parameters(*items):
    return b"".join(items) + struct.pack("<HH", 1, 0)


def text(string):
    raw = string.encode() + b"\0"
    return struct.pack("<I", len(raw)) + raw


def locator(port, address="127.0.0.1"):
    return struct.pack("<iI", 1, port) + bytes(12) + socket.inet_aton(address)


def numbers(base, bits, words=None):
    """A set of sequence numbers, in which all `bits` are there unless the words say other."""
    words = [0xFFFFFFFF] * ((bits + 31) // 32) if words is None else words
    return sequence(base) + struct.pack(f"<I{len(words)}I", bits, *words)


def data(reader, writer, number, payload, inline=b"", flags=4):
    body = struct.pack("<HH", 0, 16) + entity(reader) + entity(writer) + sequence(number) + inline + payload
    return submessage(0x15, flags | (2 if inline else 0), body)


def data_frag(reader, writer, number, start, count, fragment, size, payload, inline=b""):
    body = struct.pack("<HH", 0, 28) + entity(reader) + entity(writer) + sequence(number)
    body += struct.pack("<IHHI", start, count, fragment, size) + inline + payload
    return submessage(0x16, 2 if inline else 0, body)


def heartbeat(reader, writer, first, last, count):
    return submessage(0x07, 0, entity(reader) + entity(writer) + sequence(first) + sequence(last) + struct.pack("<i", count))


def heartbeat_frag(reader, writer, number, last, count):
    return submessage(0x13, 0, entity(reader) + entity(writer) + sequence(number) + struct.pack("<Ii", last, count))


def gap(reader, writer, start, base, bits=0):
    return submessage(0x08, 0, entity(reader) + entity(writer) + sequence(start) + numbers(base, bits))


def acknack(reader, writer, base, bits, count):
    return submessage(0x06, 0, entity(reader) + entity(writer) + numbers(base, bits) + struct.pack("<i", count))


def nack_frag(reader, writer, number, base, bits, count):
    words = [0xFFFFFFFF] * ((bits + 31) // 32)
    fragments = struct.pack(f"<II{len(words)}I", base, bits, *words)
    return submessage(0x12, 0, entity(reader) + entity(writer) + sequence(number) + fragments + struct.pack("<i", count))


def info_destination(prefix):
    return submessage(0x0E, 0, prefix)


def info_reply(count):
    return submessage(0x0F, 0, struct.pack("<I", count) + locator(9) * min(count, 4))


class Stranger:
    """A participant of one socket, in front of the node that was the first in its domain."""

    def __init__(self, domain):
        self.domain = domain
        self.prefix = bytes((1, 15)) + os.urandom(10)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        self.socket.bind(("127.0.0.1", 0))
        self.count = 0
        self.numbers = {}
        # The node is the first participant of its domain; others are not to be harmed.
        self.target, self.data_target = ports(domain, 0)

    def send(self, *parts, to_data=False):
        """One message of these parts."""
        self.raw(header(self.prefix) + b"".join(parts), self.data_target if to_data else self.target)

    def raw(self, message, port):
        try:
            self.socket.sendto(message, ("127.0.0.1", port))
        except OSError:
            # Nobody listens there, or the kernel has no room for now.
            pass

    def next(self, writer=None):
        """The next number of a heartbeat, or of a sample of the writer."""
        if writer is None:
            self.count += 1
            return self.count
        self.numbers[writer] = self.numbers.get(writer, 0) + 1
        return self.numbers[writer]

    def participant(self, prefix=None):
        """What announces a participant."""
        prefix = prefix or self.prefix
        port = self.socket.getsockname()[1]
        where = [parameter(pid, locator(port)) for pid in (0x31, 0x32)]
        return b"\0\3\0\0" + parameters(
            parameter(0x15, bytes((2, 4))),
            parameter(0x16, bytes((1, 15))),
            parameter(0x50, prefix + entity(PARTICIPANT)),
            *where,
            parameter(0x02, struct.pack("<iI", 100, 0)),
            parameter(0x58, struct.pack("<I", ENDPOINTS)),
        )

    def announce(self):
        self.send(data(SPDP_READER, SPDP_WRITER, self.next(SPDP_WRITER), self.participant()))

    def endpoint(self, topic, kind, writer=True, number=None):
        """What announces a reliable writer or reader of a topic, as DDS names it and its type."""
        guid = self.prefix + entity(number or (WRITER if writer else READER))
        return b"\0\3\0\0" + parameters(
            parameter(0x5A, guid),
            parameter(0x50, self.prefix + entity(PARTICIPANT)),
            parameter(0x05, text(topic)),
            parameter(0x07, text(kind)),
            parameter(0x2F, locator(self.socket.getsockname()[1])),
            parameter(0x1A, struct.pack("<IiI", 2, 0, 100_000_000)),
        )

    def offer(self, topic, kind, writer=True):
        to, by = (SEDP_PUBLICATIONS_READER, SEDP_PUBLICATIONS_WRITER) if writer else (
            SEDP_SUBSCRIPTIONS_READER, SEDP_SUBSCRIPTIONS_WRITER)
        self.send(data(to, by, self.next(by), self.endpoint(topic, kind, writer)))

    def answers(self, seconds):
        """What comes back within the time."""
        end, got = time.monotonic() + seconds, []
        while (left := end - time.monotonic()) > 0:
            self.socket.settimeout(left)
            try:
                got.append(self.socket.recv(65536))
            except TimeoutError:
                break
        return got
