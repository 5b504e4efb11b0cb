"""What peers and operators do to the node's network; see `tests/abuse/network.rs`, which runs
`abuse_network.py NAME [ARGUMENT]...`."""

import ctypes
import json
import os
import random
import signal
import struct
import subprocess
import sys
import threading
from pathlib import Path

from peer import *  # noqa: F403
from rcl_interfaces.srv import GetParameters
from rtps import *  # noqa: F403
from full_hd import resident
from script import child, run

IMAGE = "rt/image", "sensor_msgs::msg::dds_::Image_"
TRACKS = "rt/tracker/tracks", "long_term_tracker::msg::dds_::TrackArray_"
# What the node may take for a while, in MB: far below what each of the messages claims.
ROOM = 64
# Seconds far below the lease of a participant, which is 20 s at least.
LEASE = 8
PTRACE_ATTACH, PTRACE_DETACH, WALL = 16, 17, 0x40000000


def threads(pid):
    return sorted(Path(f"/proc/{pid}/task/{task}/comm").read_text().strip() for task in os.listdir(f"/proc/{pid}/task"))


def works(peer, frames=3):
    """The node takes images, publishes tracks and answers a service."""
    peer.follow(frames)
    client = peer.parameters = getattr(peer, "parameters", None) or peer.node.create_client(
        GetParameters, "/tracker/get_parameters"
    )
    peer.spin_until(client.service_is_ready, "the service")
    calls = []

    def answered():
        # A call is lost that comes before the node knows whom to answer.
        if not calls or time.monotonic() > calls[-1][0] + 2:
            calls.append((time.monotonic(), client.call_async(GetParameters.Request(names=["seed"]))))
        return next((call.result() for _, call in calls if call.done()), None)

    answer = peer.spin_until(answered, "an answer of the service")
    assert answer.values[0].type == 2, answer


def late_peer(name):
    """Somebody new finds the node, marks a target and is answered."""
    peer = Peer(name=name)
    peer.spin_until(lambda: "/tracker" in peer.listed(), "the node is listed by a new peer")
    peer.connect()
    peer.start()
    works(peer)
    peer.close()


def stopped(pid):
    return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] in "Tt"


def frozen(node_pid, seed):
    """The node is stopped and continued at any moments, as a shell, a debugger or a container does it."""
    pid, chance = int(node_pid), random.Random(int(seed))
    peer = Peer()
    peer.connect()
    peer.start()
    for _ in range(8):
        works(peer, chance.randrange(1, 4))
        time.sleep(chance.random() * 0.3)
        os.kill(pid, signal.SIGSTOP)
        peer.spin_until(lambda: stopped(pid), "the node is stopped")
        time.sleep(chance.random() * 0.2)
        os.kill(pid, signal.SIGCONT)
    works(peer)
    peer.close()
    late_peer("late")


def attached(node_pid):
    """A debugger attaches to each thread of the node, and lets go of it."""
    pid = int(node_pid)
    libc = ctypes.CDLL(None, use_errno=True)
    for task in map(int, os.listdir(f"/proc/{pid}/task")):
        if libc.ptrace(PTRACE_ATTACH, task, None, None) != 0:
            # The kernel may keep processes from looking into others.
            print("not allowed to attach:", os.strerror(ctypes.get_errno()))
            break
        os.waitpid(task, WALL)
        assert libc.ptrace(PTRACE_DETACH, task, None, None) == 0
    late_peer("late")


def matched(domain):
    """A stranger whom the node asks for what it announces."""
    stranger = Stranger(int(domain))
    end = time.monotonic() + DEADLINE
    while time.monotonic() < end:
        stranger.announce()
        # An ACKNACK comes once the node has taken up the stranger's announcing writers.
        if any(message[20:22] == b"\x0e\x01" and 0x06 in kinds(message) for message in stranger.answers(0.2)):
            return stranger
    raise AssertionError("the node does not ask the stranger")


def kinds(message):
    """The kinds of the submessages."""
    at, found = 20, []
    while at + 4 <= len(message):
        kind, flags, length = struct.unpack("<BBH", message[at : at + 4])
        found.append(kind)
        if length == 0:
            break
        at += 4 + length
    return found


def far(stranger):
    """Sequence numbers that are far away, of samples that there cannot be."""
    by, to = SEDP_PUBLICATIONS_WRITER, SEDP_PUBLICATIONS_READER
    for last in (1 << 40, (1 << 63) - 1, (1 << 62) + 5):
        stranger.send(heartbeat(to, by, 1, last, stranger.next()))
        stranger.send(heartbeat(to, by, last - 3, last, stranger.next()))
        stranger.send(heartbeat(to, by, last, 1, stranger.next()))
    stranger.send(heartbeat(to, by, -(1 << 62), (1 << 62), stranger.next()))
    stranger.send(heartbeat(READER, WRITER, 1, 1 << 40, stranger.next()), to_data=True)
    stranger.send(heartbeat(UNKNOWN, WRITER, 1, 1 << 40, stranger.next()), to_data=True)
    stranger.send(heartbeat_frag(to, by, 1 << 40, 0xFFFFFFFF, stranger.next()))


def gaps(stranger):
    by, to = SEDP_SUBSCRIPTIONS_WRITER, SEDP_SUBSCRIPTIONS_READER
    for start, base in ((5, 1 << 40), (1 << 41, (1 << 63) - 300), (0, 1 << 40), (1 << 40, 3), (-7, -3)):
        stranger.send(gap(to, by, start, base, 256))
    for step in range(400):
        stranger.send(gap(to, by, 10, 10 + 512 * step, 256))


def fragments(stranger):
    """Samples of 2 and 4 GiB of which a few bytes are sent, and fragments that make no sense."""
    by, to = SEDP_PUBLICATIONS_WRITER, SEDP_PUBLICATIONS_READER
    for number, size in enumerate((1 << 31, (1 << 32) - 1, 0x7FFFFFFF, 1 << 29, 1 << 28), 50):
        for reader, writer in ((to, by), (READER, WRITER), (UNKNOWN, WRITER)):
            for fragment in (1, 1024, 65535):
                stranger.send(data_frag(reader, writer, number, 1, 1, fragment, size, b"x" * min(fragment, 64)))
                stranger.send(data_frag(reader, writer, number, 1, 1, fragment, size, b"x"), to_data=True)
    # Many samples, each of a size that a camera's image may have.
    for number in range(100, 300):
        stranger.send(data_frag(UNKNOWN, WRITER, number, 1, 1, 1024, 400 << 20, b"x"), to_data=True)
        stranger.send(data_frag(to, by, number, 1, 1, 1024, 400 << 20, b"x"))
        stranger.send(heartbeat(to, by, 1, number, stranger.next()))
    odd = ((0, 1, 16, 64), (1, 0, 16, 64), (1, 1, 0, 64), (1, 1, 16, 0), (5, 1, 16, 64), (0xFFFFFFFF, 65535, 65535, 1 << 31),
           (4, 2, 16, 64), (1, 65535, 1, 65536), (1, 1, 64, 16))
    for start, count, fragment, size in odd:
        stranger.send(data_frag(to, by, 400, start, count, fragment, size, b"x" * 16))


def requests(stranger):
    """Samples and fragments are asked for that there are not; the readers belong to the stranger."""
    for by, to in (*BUILTIN, (MESSAGE_WRITER, MESSAGE_READER), (SPDP_WRITER, SPDP_READER)):
        for base in (0, 1, 2, 1 << 40, (1 << 63) - 1, -1):
            stranger.send(acknack(to, by, base, 256, stranger.next()))
            stranger.send(nack_frag(to, by, base, 0, 256, stranger.next()))
            stranger.send(nack_frag(to, by, base, 0xFFFFFFFF, 1, stranger.next()))
            stranger.send(nack_frag(to, by, 1, 1, 256, stranger.next()))
            stranger.send(nack_frag(to, by, 1, 0x80000000, 256, stranger.next()))
    for number in range(1, 40):
        stranger.send(nack_frag(SEDP_PUBLICATIONS_READER, SEDP_PUBLICATIONS_WRITER, number, 0, 256, stranger.next()))
        last = 0xFFFFFF00 - number
        stranger.send(nack_frag(SEDP_PUBLICATIONS_READER, SEDP_PUBLICATIONS_WRITER, number, last, 256, stranger.next()))


def lengths(stranger):
    """Lengths, counts and strings that do not fit into the datagram, sizes of nothing, and nothing at all."""
    by, to = SEDP_PUBLICATIONS_WRITER, SEDP_PUBLICATIONS_READER
    number = lambda: stranger.next(by)
    for pid in (0x05, 0x07, 0x2C, 0x31, 0x1A, 0x1D, 0x40, 0x71, 0x35, 0x59, 0x73, 0x5A, 0x50):
        for size in (0xFFFFFFFF, 0x7FFFFFFF, 0, 3):
            listed = b"\0\3\0\0" + parameters(parameter(pid, struct.pack("<I", size) + b"x"))
            stranger.send(data(to, by, number(), listed))
            whole = stranger.endpoint(*IMAGE)[:-4] + parameters(parameter(pid, struct.pack("<I", size) + b"x"))
            stranger.send(data(to, by, number(), whole))
            inline = parameters(parameter(pid, struct.pack("<I", size)), parameter(0x70, b"k" * (size % 20)))
            stranger.send(data(to, by, number(), b"\0\3\0\0", inline))
            stranger.send(data(to, by, number(), b"", inline, flags=0))
            stranger.send(data(to, by, number(), b"\0\1", inline, flags=8))
        stranger.send(data(to, by, number(), b"\0\3\0\0" + struct.pack("<HH", pid, 0xFFFF)))
    for count in (0, 1, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF):
        stranger.send(info_reply(count))
    for kind in range(256):
        stranger.send(submessage(kind, 0, b""), submessage(kind, 0xFE, bytes(16)), submessage(kind, 2, b"\xff" * 64))
        stranger.send(struct.pack("<BBH", kind, 1, 0xFFF0))
    for size in range(24):
        stranger.raw(header(stranger.prefix)[:size], stranger.target)
    big = struct.pack("<HH", 0, 0xFFFF) + entity(to) + entity(by) + sequence(number())
    stranger.send(submessage(0x15, 4, big + bytes(20)))


def crowd(stranger):
    """More participants than any robot has, and endpoints without end; no two datagrams of one sender."""
    chance = random.Random(5)
    for index in range(3000):
        prefix = chance.randbytes(12)
        message = header(prefix) + data(SPDP_READER, SPDP_WRITER, 1, stranger.participant(prefix))
        stranger.raw(message, stranger.target)
        by, to = SEDP_PUBLICATIONS_WRITER, SEDP_PUBLICATIONS_READER
        offer = stranger.endpoint(f"rt/crowd{index}", "std_msgs::msg::dds_::String_", number=(index << 8) + 3)
        stranger.send(data(to, by, stranger.next(by), offer))


ATTACKS = {f.__name__: f for f in (far, gaps, fragments, requests, lengths, crowd)}


def hostile(node_pid, domain, *names):
    """Each of the attacks leaves the node at work, with its threads, and takes no memory to speak of."""
    peer = Peer()
    peer.connect()
    peer.start()
    works(peer)
    stranger = matched(domain)
    stranger.offer(*IMAGE)
    stranger.offer(*TRACKS, writer=False)
    works(peer)
    alive = threads(node_pid)
    for name in names or ATTACKS:
        before = resident(node_pid)
        ATTACKS[name](stranger)
        works(peer)
        after = resident(node_pid)
        print(f"{name}: {before:.0f} to {after:.0f} MB", flush=True)
        assert after - before < ROOM, f"{name}: {before:.0f} to {after:.0f} MB"
        assert threads(node_pid) == alive, f"{name}: {threads(node_pid)}, not {alive}"
    peer.close()


def mutated(chance, message):
    """The message with some of it changed."""
    message = bytearray(message)
    for _ in range(chance.choice((1, 1, 2, 3, 8))):
        if len(message) <= 21:
            break
        at = chance.randrange(20, len(message))
        match chance.randrange(6):
            case 0:
                message[at] ^= 1 << chance.randrange(8)
            case 1:
                message[at] = chance.randrange(256)
            case 2:
                odd = chance.choice((0, 1, 0xFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0x10000))
                message[at : at + 4] = struct.pack("<I", odd)
            case 3:
                del message[at : at + chance.randrange(1, 24)]
            case 4:
                message[at:at] = chance.randbytes(chance.randrange(1, 24))
            case 5:
                start = chance.randrange(20, len(message))
                message[at:at] = message[start : start + chance.randrange(4, 64)]
    return bytes(message)


def fuzz(node_pid, domain, seed, seconds):
    """Datagrams of real participants and of the strangest kind, changed at random, for some seconds."""
    chance = random.Random(int(seed))
    peer = Peer()
    peer.connect()
    peer.start()
    stranger = matched(domain)
    stranger.offer(*IMAGE)
    stranger.offer(*TRACKS, writer=False)
    # What the node and rclpy answer, in the name of the stranger: in their own name it would be obeyed rightly.
    corpus = []
    for message in stranger.answers(1.5):
        if len(message) > 24:
            corpus.append(message.replace(message[8:20], stranger.prefix))
    assert len(corpus) > 5, f"{len(corpus)} real messages"
    sent = []
    stranger.raw = lambda message, port: sent.append(message)
    for attack in (far, requests, lengths):
        attack(stranger)
    del stranger.raw
    corpus += chance.sample(sent, 200)
    alive, before, count = threads(node_pid), resident(node_pid), 0
    grown = []
    for _ in range(2):
        end = time.monotonic() + float(seconds) / 2
        while time.monotonic() < end:
            for _ in range(200):
                message = mutated(chance, chance.choice(corpus))
                for port in (stranger.target, stranger.data_target):
                    stranger.raw(message, port)
                count += 1
            works(peer, 1)
        works(peer)
        grown.append(resident(node_pid))
    half, after = grown
    told = f"{before:.0f}, {half:.0f}, {after:.0f} MB before, after half and all of {count} messages"
    print(told, flush=True)
    # What is kept of strangers is full after half of them, however many more come: 60 to 68 MB.
    assert after - before < 1.5 * ROOM and after - half < ROOM / 4, told
    assert threads(node_pid) == alive, f"{threads(node_pid)}, not {alive}"
    peer.close()
    late_peer("late")


def malformed(domain):
    """Announcements that cannot be read, hundreds a second, hide none of those that come among them."""
    stranger = matched(domain)
    by, to = SEDP_PUBLICATIONS_WRITER, SEDP_PUBLICATIONS_READER
    done = threading.Event()

    def send():
        while not done.wait(0.002):
            stranger.send(data(to, by, stranger.next(by), b"\0\3\0\0" + parameter(0x05, text("rt/x"))))

    sender = threading.Thread(target=send)
    sender.start()
    try:
        late_peer("late")
    finally:
        done.set()
        sender.join()


def clock(simulated):
    """`/clock` is subscribed to as the clock it is, and only while time is simulated."""
    from rosgraph_msgs.msg import Clock
    from diagnostic_msgs.msg import DiagnosticArray
    from rcl_interfaces.msg import Parameter, ParameterValue
    from rcl_interfaces.srv import SetParameters

    peer = Peer()
    peer.spin_until(lambda: "/tracker" in peer.listed(), "the node is listed")
    told = peer.listen(DiagnosticArray, "/diagnostics", 10)
    peer.spin_until(lambda: told, "diagnostics")
    topics = lambda: dict(peer.node.get_topic_names_and_types()).get("/clock", [])
    if simulated == "no":
        assert topics() == [], topics()
        value = ParameterValue(type=1, bool_value=True)
        request = SetParameters.Request(parameters=[Parameter(name="use_sim_time", value=value)])
        assert peer.call(SetParameters, "/tracker/set_parameters", request).results[0].successful
    peer.spin_until(topics, "/clock is subscribed to")
    assert topics() == ["rosgraph_msgs/msg/Clock"], topics()
    ticks = peer.node.create_publisher(Clock, "/clock", 10)
    tick = Clock()
    tick.clock.sec = 4321

    def simulated_stamp():
        ticks.publish(tick)
        return told[-1].header.stamp.sec == 4321

    peer.spin_until(simulated_stamp, "diagnostics with the simulated time")
    peer.close()


def type_hashes(prefixes):
    """The hash of each topic's type is that of its definition, as rosidl has computed it."""
    peer = Peer()
    peer.spin_until(lambda: "/tracker" in peer.listed(), "the node is listed")
    peer.spin_until(lambda: peer.node.get_service_names_and_types_by_node("tracker", "/"), "its services")
    seen = {}
    for name, kinds in topics_of(peer):
        for kind in kinds:
            seen[kind] = {str(info.topic_type_hash) for info in infos(peer, name) if info.node_name == "tracker"}
    for name, kind in (("stop", "std_srvs/srv/Trigger"), ("get_parameters", "rcl_interfaces/srv/GetParameters")):
        for part, wire in (("Request", f"rq/tracker/{name}Request"), ("Response", f"rr/tracker/{name}Reply")):
            seen[f"{kind}_{part}"] = {str(info.topic_type_hash) for info in infos(peer, wire, no_mangle=True)}
    assert len(seen) >= 12, seen
    for kind, hashes in seen.items():
        file = kind.removesuffix("_Request").removesuffix("_Response") + ".json"
        paths = [Path(prefix, "share", file) for prefix in prefixes.split(":")]
        described = json.loads(next(p for p in paths if p.exists()).read_text())
        right = next(h["hash_string"] for h in described["type_hashes"] if h["type_name"] == kind)
        assert hashes == {right}, f"{kind}: {hashes}, not {right}"
    print(f"{len(seen)} types: {', '.join(sorted(seen))}")
    peer.close()


def topics_of(peer):
    node = peer.node
    topics = node.get_publisher_names_and_types_by_node("tracker", "/")
    return topics + node.get_subscriber_names_and_types_by_node("tracker", "/")


def infos(peer, topic, **names):
    node = peer.node
    return node.get_publishers_info_by_topic(topic, **names) + node.get_subscriptions_info_by_topic(topic, **names)


def namesake(name):
    """A node of that name comes, looks around and goes."""
    peer = Peer(name=name)
    peer.spin_until(lambda: "/tracker" in peer.listed(), "the node is listed")
    peer.connect()
    peer.close()


def goodbye(node_pid):
    """A node that ends in order is gone from the network at once, and not when its lease has ended."""
    peer = Peer()
    marks = peer.node.create_publisher(RegionOfInterest, "/tracker/init_roi", 10)
    peer.spin_until(lambda: "/tracker" in peer.listed() and marks.get_subscription_count() == 1, "the node is seen")
    os.kill(int(node_pid), signal.SIGINT)
    begun = time.monotonic()
    peer.spin_until(lambda: marks.get_subscription_count() == 0, "its subscriptions are gone", LEASE)
    peer.spin_until(lambda: "/tracker" not in peer.listed(), "it is gone", LEASE)
    print(f"gone {time.monotonic() - begun:.2f} s after the signal")
    peer.close()


def started_together(path, count, rounds):
    """Nodes that start at once are all seen by one that was there before."""
    for turn in range(int(rounds)):
        peer = Peer(name=f"watcher{turn}")
        names = [f"eye{turn}_{n}" for n in range(int(count))]
        nodes = [child([path, "--ros-args", "-r", f"__node:={name}"], stderr=subprocess.DEVNULL) for name in names]
        try:
            tracks = lambda: [name for name, _ in peer.node.get_topic_names_and_types() if name.endswith("/tracks")]
            wanted = {f"/{name}" for name in names}
            peer.spin_until(lambda: wanted <= set(peer.listed()), "all nodes are listed", 3 * DEADLINE)
            peer.spin_until(lambda: {f"{name}/tracks" for name in wanted} <= set(tracks()), "all topics are listed")
        finally:
            for node in nodes:
                node.kill()
                node.wait()
        peer.close()


if __name__ == "__main__":
    run(globals()[sys.argv[1]], *sys.argv[2:])
