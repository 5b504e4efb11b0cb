"""A camera of 1920 x 1080 at 30 Hz; part of `scenarios.py`."""

from peer import *  # noqa: F403

# Frames of the scene, which are played there and back again so that the target never jumps.
RING = 24
# Of the scene's own pace, so that the target goes no faster across the image than people do.
PACE = 0.25
RATE = 30
# Megabytes: what the node may hold at most; and three frames, for more or fewer may be on their way.
MOST, GROWTH = 300, 19


def full_hd(node_pid, seconds):
    """Follows a target for so long; prints what was sent, what was answered and what the node held."""
    peer = Peer()
    peer.scene = Scene(1920, 1080, (90, 160))
    ring = [image_message(peer.scene.rgb(index * PACE), "rgb8", index) for index in range(RING)]
    peer.connect()
    peer.start()
    frames = round(RATE * float(seconds))
    sizes, tardy = [], 0
    begun = time.monotonic()
    for n in range(frames):
        turn = (n + 1) % (2 * RING - 2)
        message = ring[min(turn, 2 * RING - 2 - turn)]
        nanos = 2_000_000_000_000 + n * 33_333_333
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(nanos, 1_000_000_000)
        tardy += time.monotonic() > begun + (n + 1) / RATE
        peer.images.publish(message)
        if n % (frames // 20) == 0:
            sizes.append(resident(node_pid))
        while (left := begun + (n + 1) / RATE - time.monotonic()) > 0:
            peer.executor.spin_once(timeout_sec=left)
    took = time.monotonic() - begun
    end = time.monotonic() + 1
    while time.monotonic() < end:
        peer.executor.spin_once(timeout_sec=0.05)
    said = [t for t in peer.tracks if stamp_of(t)[0] >= 2000]
    states = [t.tracks[0].state for t in said]
    print(f"sent {frames} in {took:.1f} s, {tardy} of them late; answered {len(said)}; resident {sizes} MB")
    assert states and states.count(0) > 0.9 * len(states), f"tracking in {states.count(0)} of {len(states)}"
    # The first fifth fills caches and the memory of samples.
    early, late = np.median(sizes[4:8]), np.median(sizes[-4:])
    assert max(sizes) < MOST and late - early < GROWTH, sizes
    peer.close()


def resident(pid):
    """Resident memory of a process in MB."""
    with open(f"/proc/{pid}/status") as file:
        line = next(line for line in file if line.startswith("VmRSS"))
    return round(int(line.split()[1]) / 1024, 1)
