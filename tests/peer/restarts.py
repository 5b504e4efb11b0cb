"""Either side is killed and comes back; part of `scenarios.py`."""

import os
import signal
import subprocess

from peer import *  # noqa: F403
from script import child

# Seconds, on an idle machine, within which images must flow again, and within which the node must end.
BACK, GONE = 3.0, 1.0
# Seconds within which who says goodbye is listed no more. Who does not stays for a minute.
UNLISTED = 20.0


def start_node(path):
    """The node as a child that does not outlive this process."""
    return child([path], stderr=subprocess.DEVNULL)


def flow(peer):
    """Publishes at 30 Hz until an image is answered. Gives how long that took, in seconds of an idle machine."""
    began = time.monotonic()
    due = time.monotonic()

    def answered():
        nonlocal due
        if time.monotonic() >= due:
            peer.index += 1
            peer.images.publish(peer.message(peer.index))
            due += 1 / 30
        return peer.tracks

    peer.spin_until(answered, "tracks again")
    return (time.monotonic() - began) / slowness()


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
        took.append(flow(peer))
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
    code = node.wait(DEADLINE)
    ended = (time.monotonic() - sent) / slowness()
    assert code == 0, code
    # The killed ones are listed until their leases expire; this one has said goodbye.
    peer.spin_until(lambda: listed() < before, "one less is listed", UNLISTED)
    print(f"images flow {np.median(took):.2f} s after a start, {max(took):.2f} s at most; SIGINT: ended after {ended:.2f} s")
    # The machine may be busier for a while than it is found to be, but not each time.
    assert np.median(took) < BACK and ended < GONE, (took, ended)
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


def killed_peer(times):
    """A camera that is killed in the middle of it all. Adds to a file how long it took until images flowed."""
    peer = Peer()
    took = flow(peer)
    mark_and_follow(peer)
    with open(times, "a") as file:
        print(took, file=file)
    os.kill(os.getpid(), signal.SIGKILL)
