"""Marks and requests at any rate, and a node that hangs or grows; run as `abuse_marks.py NAME [ARGUMENT]...`."""

import ctypes
import os
import signal
import subprocess
import sys
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray
from input import detection_of
from parameters import integer
from peer import *  # noqa: F403
from rcl_interfaces.srv import SetParameters
from restarts import start_node
from script import run

# Images a second, few enough for two nodes on a busy machine, and marks a second.
IMAGES, MARKS = 15, 30
# Seconds of images to compare by, and the share that must be tracked of what is tracked without marks.
WINDOW, LEAST = 8.0, 0.9
# Another process may take the processor for a while, but not each time.
ROUNDS = 4
# Seconds within which a signal ends the node.
GONE = 1.0
# Of ptrace(2) and wait(2).
PTRACE_SEIZE, PTRACE_INTERRUPT, WALL = 0x4206, 0x4207, 0x40000000


class Detector:
    """Marks the target for one node, as often as it is told to."""

    def __init__(self, peer, tracker="/tracker"):
        self.peer = peer
        self.detections = peer.node.create_publisher(Detection2D, f"{tracker}/init_detection", 10)
        self.marks = peer.node.create_publisher(RegionOfInterest, f"{tracker}/init_roi", 10)
        matched = lambda: self.detections.get_subscription_count() and self.marks.get_subscription_count()
        peer.spin_until(matched, "the topics of marks")

    def by_id(self, *ids):
        """The target of the latest image, by its stamp and each of the ids."""
        box, stamp = self.peer.scene.box(self.peer.index), stamp_of(self.peer.message(self.peer.index))
        for id in ids:
            self.detections.publish(detection_of(box, stamp, id))

    def plain(self):
        """The target of the latest image."""
        x, y, w, h = self.peer.scene.box(self.peer.index)
        self.marks.publish(RegionOfInterest(x_offset=x, y_offset=y, width=w, height=h))

    def all(self, *ids):
        self.by_id(*ids)
        self.plain()

    def stop(self):
        self.marks.publish(RegionOfInterest())


def flow(peer, seconds, between=lambda due: None):
    """Images, and a second to hear of the last. `between` is called for each mark that is due, with the time of the next."""
    begun = time.monotonic()
    for n in range(round(MARKS * seconds)):
        if n * IMAGES % MARKS == 0:
            peer.index += 1
            peer.images.publish(peer.message(peer.index))
        due = begun + (n + 1) / MARKS
        between(due)
        while (left := due - time.monotonic()) > 0:
            peer.executor.spin_once(timeout_sec=left)
    end = time.monotonic() + 1
    while time.monotonic() < end:
        peer.executor.spin_once(timeout_sec=0.05)


def rate(pid, beside_pid):
    """Two nodes see the same images, and one of them is marked at 30 Hz and as fast as can be: it tracks nearly as many.
    Then a signal ends it at once."""
    peer = Peer()
    said, told = {"/tracker": peer.tracks, "/beside": []}, peer.listen(DiagnosticArray, "/diagnostics", 10)
    peer.node.create_subscription(TrackArray, "/beside/tracks", said["/beside"].append, 1000)
    marked, beside = (Detector(peer, name) for name in said)
    peer.connect()

    def follow_both(ids):
        """Takes up the same targets in both."""

        def followed():
            for detector, tracks in zip((marked, beside), said.values()):
                if not (tracks and len(tracks[-1].tracks) == max(len(ids), 1)):
                    detector.by_id(*ids) if ids else detector.plain()
            flow(peer, 0.5)
            return all(tracks and len(tracks[-1].tracks) == max(len(ids), 1) for tracks in said.values())

        peer.spin_until(followed, "the start in both", 2 * DEADLINE)

    def count(tracks, first):
        return len({stamp_of(t) for t in tracks if t.tracks and stamp_of(t) >= stamp_of(peer.message(first))})

    def compare(what, ids, between):
        shares = []
        for _ in range(ROUNDS):
            first = peer.index + 1
            [tracks.clear() for tracks in said.values()]
            flow(peer, WINDOW, between)
            counts = [count(tracks, first) for tracks in said.values()]
            seen = {t.id for message in peer.tracks for t in message.tracks}
            print(f"{what}: {counts[0]} images tracked, {counts[1]} without marks; targets {sorted(seen)}", flush=True)
            assert counts[1] > 10, "the node beside tracks"
            shares.append(counts[0] / counts[1])
            if shares[-1] >= LEAST and set(ids) <= seen:
                return
        raise AssertionError(f"{what}: shares {shares}, targets {seen}")

    def flood(due):
        while time.monotonic() < due - 0.005:
            marked.all("a", "b")
            peer.executor.spin_once(timeout_sec=0)

    follow_both([])
    # A handful of marks is obeyed at once. What is compared are the marks after it.
    flow(peer, 4, lambda _: marked.all("a"))
    compare("30 Hz, with an id and without", [], lambda _: marked.all("a"))
    for detector, name in zip((marked, beside), said):
        request = SetParameters.Request(parameters=[integer("max_targets", 2)])
        assert peer.call(SetParameters, f"{name}/set_parameters", request).results[0].successful
        detector.stop()
    follow_both(["a", "b"])
    compare("30 Hz each of two targets", "ab", lambda _: marked.by_id("a", "b"))
    compare("as fast as can be", "ab", flood)
    status = [s for m in told for s in m.status if s.name == "tracker: targets"]
    superseded = [int(v.value) for s in status for v in s.values if v.key == "marks superseded"]
    assert superseded and superseded[-1] > 100, superseded

    def ended(pid):
        """Seconds from the signal to the end, while marks come."""
        stat = Path(f"/proc/{pid}/stat")
        os.kill(int(pid), signal.SIGINT)
        sent = time.monotonic()
        while stat.read_text().rsplit(")", 1)[1].split()[0] != "Z":
            assert time.monotonic() - sent < DEADLINE, "the node runs on"
            marked.all("a", "b")
        return time.monotonic() - sent

    flow(peer, 1, flood)
    took, control = ended(pid), ended(beside_pid)
    print(f"SIGINT: ended after {took:.2f} s; without marks {control:.2f} s")
    assert took < max(GONE, 2 * control), (took, control)
    peer.close()


def requests():
    """All of many requests that come at once are answered, while marks come as fast as can be; and a stop makes the marks
    before it void."""
    peer = Peer()
    detector = Detector(peer)
    peer.connect()
    peer.start()
    # A client keeps the ten newest answers of its service, those to other clients among them: more at once it loses itself.
    clients = [peer.node.create_client(Trigger, f"/tracker/{name}") for name in ("restart", "stop") for _ in range(2)]
    for client in clients:
        peer.spin_until(client.service_is_ready, "a service")
    futures = []
    for n in range(5):
        for _ in range(10):
            detector.all("a", "b")
        futures += [client.call_async(Trigger.Request()) for client in clients]
        peer.index += 1
        peer.images.publish(peer.message(peer.index))

    def answered():
        detector.all("a", "b")
        return all(future.done() for future in futures)

    peer.spin_until(answered, "every answer")
    messages = {future.result().message for future in futures}
    done, void = ("restarted: ", "stopped", "there was no target"), ("stopped before", "no target has been marked")
    assert all(message.startswith(done + void) for message in messages), messages
    assert all(f.result().success != f.result().message.startswith(void) for f in futures), messages

    for _ in range(50):
        detector.plain()
    detector.stop()
    detector.detections.publish(detection_of((0, 0, 0, 0)))
    peer.spin_until(lambda: not peer.step().tracks, "the stop")
    # What has run ahead of its share would be due by then.
    end = time.monotonic() + 3
    while time.monotonic() < end:
        assert not peer.step().tracks, "the marks before the stop are void"
    peer.close()


def thread_of(pid, name):
    """The thread that the system knows by this name, as soon as it has given itself that."""
    end = time.monotonic() + DEADLINE
    while time.monotonic() < end:
        for task in Path(f"/proc/{pid}/task").iterdir():
            if (task / "comm").read_text().strip() == name:
                return int(task.name)
    raise AssertionError(f"no thread {name}")


def hold(pid, thread):
    """Holds one thread, as a debugger does."""
    for request in (PTRACE_SEIZE, PTRACE_INTERRUPT):
        assert ctypes.CDLL(None, use_errno=True).ptrace(request, thread, None, None) == 0, os.strerror(ctypes.get_errno())
    state = lambda: Path(f"/proc/{pid}/task/{thread}/stat").read_text().rsplit(")", 1)[1].split()[0]
    end = time.monotonic() + DEADLINE
    while state() != "t":
        assert time.monotonic() < end, "the thread runs on"


def hung(path):
    """A thread stands still for good: signals end the process all the same, and it says which."""
    for name, told, signals in [
        ("worker", "worker", [signal.SIGINT]),
        ("spin", "spin", [signal.SIGTERM, signal.SIGINT]),
        ("RustDDS discove", "DDS", [signal.SIGINT, signal.SIGTERM]),
    ]:
        node = subprocess.Popen([path], stderr=subprocess.PIPE, text=True)
        try:
            lines = iter(node.stderr.readline, "")
            assert any("waits for images" in line for line in lines)
            thread = thread_of(node.pid, name)
            hold(node.pid, thread)
            begun = time.monotonic()
            for each in signals:
                node.send_signal(each)
            while node.poll() is None:
                assert time.monotonic() - begun < DEADLINE, f"with the {name} thread held the node runs on"
                try:
                    # Its tracer must take leave of a dead thread before the process can be waited for.
                    os.waitpid(thread, os.WNOHANG | WALL)
                except ChildProcessError:
                    pass
            took, log = time.monotonic() - begun, node.stderr.read()
        finally:
            node.kill()
        # On a busy machine others may not have ended either.
        assert node.returncode == 1 and told in log.split("the process is ended: ")[1], (node.returncode, log)
        after = float(log.split("still running ")[1].split(" s after")[0])
        print(f"{name} held, {len(signals)} signals: ended after {took:.2f} s")
        assert (3 <= after) if len(signals) == 1 else (after < 3), log


def big_images(pid):
    """Images of 6 MB, until the node is gone."""
    peer = Peer()
    peer.scene = Scene(1920, 1080, (60, 120))
    message = peer.message(0)
    stat = Path(f"/proc/{pid}/stat")

    def gone():
        peer.index += 1
        peer.images.publish(stamped(message, peer.index))
        return stat.read_text().rsplit(")", 1)[1].split()[0] == "Z"

    peer.spin_until(gone, "the end of the node")
    peer.close()


if __name__ == "__main__":
    run(globals()[sys.argv[1]], *sys.argv[2:])
