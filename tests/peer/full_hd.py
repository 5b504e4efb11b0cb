"""A camera of 1920 x 1080; part of `scenarios.py`."""

from peer import *  # noqa: F403

# Frames of the scene, which are played there and back again so that the target never jumps.
RING = 24
# Of the scene's own pace, so that the target goes no faster across the image than people do.
PACE = 0.25
RATE = 30
# Megabytes: what the node may hold at most; and three frames, for more or fewer may be on their way at any time.
MOST, GROWTH = 300, 19


def full_hd(node_pid, frames, at_its_rate):
    """Follows a target through so many images, each sent when the last is answered, or at the camera's rate whether it is or
    not; prints what was sent, what was answered and what the node held."""
    frames, waits = int(frames), not int(at_its_rate)
    peer = Peer()
    peer.scene = Scene(1920, 1080, (90, 160))
    ring = [image_message(peer.scene.rgb(index * PACE), "rgb8", index) for index in range(RING)]
    peer.connect()
    peer.start()
    sizes, stamps = [], []
    begun = time.monotonic()
    for n in range(frames):
        turn = (n + 1) % (2 * RING - 2)
        message = ring[min(turn, 2 * RING - 2 - turn)]
        nanos = 2_000_000_000_000 + n * 33_333_333
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(nanos, 1_000_000_000)
        stamps.append(stamp_of(message))
        peer.images.publish(message)
        if waits:
            peer.spin_for(lambda: peer.tracks and stamp_of(peer.tracks[-1]) == stamps[-1], AGAIN)
        while (left := begun + (n + 1) / RATE - time.monotonic()) > 0 and not waits:
            peer.executor.spin_once(timeout_sec=left)
        sizes.append(resident(node_pid))
    took = time.monotonic() - begun
    peer.spin_for(lambda: peer.tracks and stamp_of(peer.tracks[-1]) == stamps[-1], AGAIN)
    said = [t for t in peer.tracks if stamp_of(t) in set(stamps)]
    states = [t.tracks[0].state for t in said]
    windows = [float(min(window)) for window in np.array_split(sizes, 5)]
    print(f"sent {frames} in {took:.1f} s; answered {len(said)}; resident {windows} MB at least, {max(sizes)} MB at most")
    assert states and states.count(0) > 0.9 * len(states), f"tracking in {states.count(0)} of {len(states)}"
    # The first fifth fills caches and the memory of samples.
    assert max(sizes) < MOST and windows[-1] - windows[1] < GROWTH, (windows, max(sizes))
    peer.close()


def resident(pid):
    """Resident memory of a process in MB."""
    with open(f"/proc/{pid}/status") as file:
        line = next(line for line in file if line.startswith("VmRSS"))
    return round(int(line.split()[1]) / 1024, 1)
