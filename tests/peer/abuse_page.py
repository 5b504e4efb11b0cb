"""What strangers do to the node's live page; see `tests/abuse/page.rs`, which runs
`abuse_page.py NAME [ARGUMENT]...`."""

import base64
import json
import os
import socket
import struct
import sys

from full_hd import resident
from peer import *  # noqa: F403
from script import run

# What the node may take for a while, in MB: far below what is sent to it.
ROOM = 32
# Connections that are opened at once, pictures that a page may wait for, and what a greedy one asks for.
CROWD = 200
MOST_PICTURES = 2
GREED = 500
TEXT, BINARY, CLOSE, PING = 1, 2, 8, 9


class Stranger:
    """A connection to the page's port, byte by byte."""

    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", int(port)), timeout=DEADLINE)
        self.file = self.socket.makefile("rb")
        self.home = f"127.0.0.1:{port}"

    def get(self, path="/", host=None, more=""):
        """Sends a request; gives the status, or 0 where the other side hung up."""
        self.write(f"GET {path} HTTP/1.1\r\nHost: {host or self.home}\r\n{more}\r\n".encode())
        try:
            words = self.file.readline().split()
        except ConnectionError:
            return 0
        return int(words[1]) if words else 0

    def write(self, data):
        try:
            self.socket.sendall(data)
        except ConnectionError:
            pass  # It was hung up on.

    def upgrade(self, origin=None):
        """Asks for a WebSocket; gives the status."""
        key = base64.b64encode(os.urandom(16)).decode()
        more = (
            f"Origin: {origin or 'http://' + self.home}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {key}\r\n"
        )
        status = self.get("/live", more=more)
        while status == 101 and self.file.readline().strip():
            pass
        return status

    def say(self, text, kind=TEXT):
        """Sends a WebSocket message, masked by nothing."""
        data = text.encode() if isinstance(text, str) else text
        if len(data) < 126:
            length = bytes([0x80 | len(data)])
        elif len(data) <= 0xFFFF:
            length = struct.pack(">BH", 0xFE, len(data))
        else:
            length = struct.pack(">BQ", 0xFF, len(data))
        self.write(bytes([0x80 | kind]) + length + bytes(4) + data)

    def hear(self):
        """The next message's kind and bytes, or nothing after the last."""
        try:
            head = self.file.read(2)
            if len(head) < 2:
                return None
            kind, length = head[0] & 0x0F, head[1] & 0x7F
            if length >= 126:
                size = 2 if length == 126 else 8
                length = int.from_bytes(self.file.read(size), "big")
            return kind, self.file.read(length)
        except ConnectionError:
            return None

    def texts(self):
        """What is said in text until the other side hangs up."""
        while (heard := self.hear()) is not None and heard[0] != CLOSE:
            if heard[0] == TEXT:
                yield json.loads(heard[1])

    def wait_for(self, kind):
        return next((text[kind] for text in self.texts() if kind in text), None)


def page(port, token):
    """A page that was let in."""
    stranger = Stranger(port)
    assert stranger.upgrade() == 101
    stranger.say(json.dumps({"enter": {"token": token}}))
    assert stranger.wait_for("hello"), "the page was not let in"
    return stranger


def threads(pid):
    return len(os.listdir(f"/proc/{pid}/task"))


def ask(command):
    return f'{{"ask": {{"number": 1, "command": {command}}}}}'


def refusals(port, token):
    """Each does something that is refused."""

    def wrong_token():
        for given in ("", token[:-1], token + "0"):
            stranger = Stranger(port)
            assert stranger.upgrade() == 101
            stranger.say(json.dumps({"enter": {"token": given}}))
            assert stranger.wait_for("refused")["why"] == "the token is wrong"

    def no_token():
        stranger = Stranger(port)
        assert stranger.upgrade() == 101
        stranger.say(ask('{"stop": {"id": null}}'))
        assert stranger.wait_for("refused")

    def other_origin():
        assert Stranger(port).upgrade("http://evil.example") == 403
        assert Stranger(port).upgrade("null") == 403
        assert Stranger(port).get(more="Origin: http://evil.example\r\n") == 403

    def other_host():
        assert Stranger(port).get(host=f"evil.example:{port}") == 403
        assert Stranger(port).get("/live", host=f"192.168.1.2:{port}") == 403

    def endless_header():
        assert Stranger(port).get(more=f"X: {'x' * 1_000_000}\r\n") in (0, 431)

    def crowd():
        held = [Stranger(port) for _ in range(CROWD)]
        assert all(stranger.hear() is None for stranger in held), "those who say nothing are hung up on"

    def garbage():
        for said, kind in (("{", TEXT), ("[" * 60_000, TEXT), ("x" * 1_000_000, TEXT), (bytes(range(256)), BINARY)):
            stranger = page(port, token)
            stranger.say(said, kind)
            list(stranger.texts())
        stranger = page(port, token)
        stranger.write(os.urandom(100_000))
        list(stranger.texts())

    def no_numbers():
        for rect in ("[NaN, 1, 20, 30]", "[1, 1e999, 20, 30]", "[1, 2, null, 30]", "[1, 2, 20]"):
            stranger = page(port, token)
            stranger.say(ask(f'{{"mark": {{"rect": {rect}, "id": null, "stamp": null}}}}'))
            assert stranger.wait_for("refused"), rect

    def no_box():
        for rect in ([1e300, 0, 20, 20], [0, 0, -20, -20], [0, 0, 1e300, 1e300], [-900, -900, 20, 20]):
            stranger = page(port, token)
            stranger.say(ask(json.dumps({"mark": {"rect": rect, "id": None, "stamp": None}})))
            told = (event for news in stranger.texts() for event in news.get("news", {}).get("events", []))
            assert next(event for event in told if event["kind"] == "refused" and event["rect"] == rect)["text"]

    return [wrong_token, no_token, other_origin, other_host, endless_header, crowd, garbage, no_numbers, no_box]


def strangers(pid, port, token):
    """Whatever they do, the target is followed on, and the page opens to those who may see it."""
    peer = Peer()
    peer.connect()
    marked = peer.start().tracks[0]
    peer.follow(3)
    page(port, token)
    before, busy, age = resident(pid), threads(pid), marked.age + 3
    for attack in refusals(port, token):
        attack()
        page(port, token)
        followed = peer.follow(2).tracks[0]
        age += 2
        assert (followed.id, followed.age) == (marked.id, age), f"after {attack.__name__}: {followed}"
        print(f"{attack.__name__}: refused; the node holds {resident(pid)} MB, before {before} MB", flush=True)
        assert resident(pid) < before + ROOM and threads(pid) == busy
    peer.close()


def deaf(pid, port, token, frames):
    """Pages that stop reading are sent no more than they waited for, and the node holds nothing for them."""
    peer = Peer()
    peer.connect()
    peer.start()
    look = json.dumps({"look": {"side": 320}})
    still, greedy = page(port, token), page(port, token)
    for _ in range(MOST_PICTURES):
        still.say(look)
    for _ in range(GREED):
        greedy.say(look)
    peer.follow(5)
    before, most, began = resident(pid), 0, time.monotonic()
    for _ in range(int(frames)):
        peer.follow(1)
        most = max(most, resident(pid))
    print(f"{time.monotonic() - began:.0f} s without reading: from {before} to at most {most} MB", flush=True)
    assert most < before + ROOM
    still.socket.shutdown(socket.SHUT_WR)
    pictures = 0
    while (heard := still.hear()) is not None and heard[0] != CLOSE:
        pictures += heard[0] == BINARY
    assert pictures <= MOST_PICTURES, f"{pictures} pictures came"
    peer.follow(3)
    peer.close()


if __name__ == "__main__":
    run(globals()[sys.argv[1]], *sys.argv[2:])
