"""Either side is killed and comes back; part of `scenarios.py`."""

import ctypes
import os
import signal
import subprocess

from peer import *  # noqa: F403

# Seconds within which images must flow again, and within which the node must end and be gone.
BACK, GONE = 3.0, 1.0
# Of prctl(2): the signal that a process gets when its parent dies.
PR_SET_PDEATHSIG = 1


def start_node(path):
    """The node as a child that does not outlive this process."""
    die_with_parent = lambda: ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    return subprocess.Popen([path], stderr=subprocess.DEVNULL, preexec_fn=die_with_parent)


def flow(peer):
    """Publishes at 30 Hz until an image is answered."""
    due = time.monotonic()

    def answered():
        nonlocal due
        if time.monotonic() >= due:
            peer.index += 1
            peer.images.publish(peer.message(peer.index))
            due += 1 / 30
        return peer.tracks

    peer.spin_until(answered, "tracks again", BACK)


def mark_and_follow(peer):
    """Marks the target until it is followed, for a mark may come before the node knows this writer; follows it."""

    def followed():
        said = peer.step()
        peer.mark(*peer.scene.box(peer.index))
        return said.tracks

    peer.spin_until(followed, "a target")
    peer.follow(5)


def killed_node(path, times):
    """The node is killed so often while the camera stays; then SIGINT ends it."""
    peer = Peer()
    took = []
    for _ in range(int(times)):
        node = start_node(path)
        began = time.monotonic()
        flow(peer)
        took.append(time.monotonic() - began)
        mark_and_follow(peer)
        node.kill()
        node.wait()
        drain(peer)
    node = start_node(path)
    flow(peer)
    mark_and_follow(peer)
    listed = lambda: peer.listed().count("/tracker")
    before = listed()
    sent = time.monotonic()
    node.send_signal(signal.SIGINT)
    code = node.wait(GONE)
    ended = time.monotonic() - sent
    assert code == 0, code
    # The killed ones are listed until their leases expire; this one has said goodbye.
    peer.spin_until(lambda: listed() < before, "one less is listed", GONE)
    print(f"images flow {max(took):.2f} s after a start at most; SIGINT: ended after {ended:.2f} s")
    peer.close()


def drain(peer):
    """Takes what a dead node has left on the way."""
    while True:
        heard = len(peer.tracks) + len(peer.detections)
        peer.executor.spin_once(timeout_sec=0.05)
        if len(peer.tracks) + len(peer.detections) == heard:
            break
    peer.tracks.clear()
    peer.detections.clear()


def killed_peer():
    """A camera that is killed in the middle of it all."""
    began = time.monotonic()
    peer = Peer()
    flow(peer)
    print(f"images flow {time.monotonic() - began:.2f} s after the peer's start")
    mark_and_follow(peer)
    os.kill(os.getpid(), signal.SIGKILL)
