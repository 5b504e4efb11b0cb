"""One function a test; see `tests/ros_node.rs`, which runs `scenarios.py NAME [ARGUMENT]...`."""

import io
import os
import signal
import struct
import subprocess
import sys
import threading
import zlib
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray
from input import *  # noqa: F403
from long_term_tracker.msg import Track
from peer import *  # noqa: F403
from rcl_interfaces.msg import ParameterEvent, Log
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from abuse import *  # noqa: F403
from full_hd import *  # noqa: F403
from parameters import *  # noqa: F403
from restarts import *  # noqa: F403
from script import child, run


def whole_life(node_pid, algorithm):
    """Marks, follows, looks at the debug images, sets a parameter, stops, restarts, and sees the node go."""
    peer = Peer()
    peer.spin_until(lambda: "/tracker" in peer.listed(), "the node is listed")
    peer.connect()
    assert peer.step().tracks == [], "nothing is followed before the mark"
    marked = peer.start()
    assert iou(box_of(marked.tracks[0]), peer.scene.box(peer.index)) > 0.99
    assert stamp_of(marked) == stamp_of(peer.message(peer.index)), "the start bears the newest frame's stamp"
    said = peer.follow(20)
    assert (said.algorithm, said.header.frame_id) == (algorithm, "camera_optical")
    assert said.tracks[0].id == "0" and said.tracks[0].age == 20 and said.skipped == 0, said
    processing = said.processing_time.sec + said.processing_time.nanosec * 1e-9
    assert 0 < processing < peer.took, (processing, peer.took)

    stamp = stamp_of(said)
    seen = peer.spin_until(lambda: next((d for d in peer.detections if stamp_of(d) == stamp), None), "detections")
    assert stamp_of(seen.detections[0]) == stamp and seen.detections[0].id == "0"
    assert seen.detections[0].bbox.center.position.x == said.tracks[0].center_x
    assert seen.detections[0].results[0].hypothesis.score == said.tracks[0].confidence

    debug_images(peer)
    parameter_takes_effect(peer)

    answer = peer.trigger("stop")
    assert answer.success and answer.message == "stopped", answer
    assert peer.step().tracks == []
    first = peer.scene.box(1)
    peer.index = 0
    peer.send(peer.message(1))
    answer = peer.trigger("restart")
    assert answer.success, answer
    restarted = peer.spin_until(lambda: next((t for t in peer.tracks[::-1] if t.tracks), None), "the restart")
    assert iou(box_of(restarted.tracks[0]), first) > 0.99 and restarted.tracks[0].id == "1"
    peer.index = 1
    peer.follow(5)

    peer.mark(0, 0, 0, 0)
    peer.spin_until(lambda: not peer.step().tracks, "a mark of 0 x 0 stops")

    os.kill(int(node_pid), signal.SIGINT)
    peer.spin_until(lambda: "/tracker" not in peer.listed(), "the node is gone", UNLISTED)
    peer.close()


def found():
    """Nothing is marked: what moves is found, keeps its id, can be stopped, and is found again after a restart."""
    peer = Peer()
    # First the camera sees the background alone.
    peer.scene.hidden = range(100)
    peer.connect()
    looked = []
    peer.node.create_subscription(Image, "/tracker/debug/response", looked.append, qos_profile_sensor_data)

    def on_target(said):
        box = peer.scene.box(peer.index)
        return next((t for t in said.tracks if t.state == Track.TRACKING and iou(box_of(t), box) > 0.3), None)

    def find():
        for _ in range(60):
            track = on_target(peer.step())
            if track:
                return track
        raise AssertionError("what moves was not found within 60 frames")

    assert not any(peer.step().tracks for _ in range(99)), "nothing moves yet"
    first = find()
    for _ in range(60):
        said = peer.step()
        track = on_target(said)
        assert said.algorithm == "maptrack" and track and track.id == first.id, said
    peer.spin_until(lambda: peer.step() and looked, "the images of its region")

    assert peer.trigger("stop").success
    assert not any(peer.step().tracks for _ in range(20)), "nothing is found after a stop"
    assert peer.trigger("restart").success
    again = find()
    assert again.id != first.id, again
    # A mark starts a target beside what is found.
    peer.mark(10, 10, 30, 30)
    peer.spin_until(lambda: len(peer.step().tracks) > 1, "the mark's track")
    peer.close()


def debug_images(peer):
    """Raw ones scaled down, compressed ones at full size, for both pictures; with the image's header."""
    topics = ["debug/image", "debug/response"]
    raw = {t: peer.listen(Image, f"/tracker/{t}") for t in topics}
    jpeg = {t: peer.listen(CompressedImage, f"/tracker/{t}/compressed") for t in topics}

    def complete():
        peer.follow(1)
        return all(raw.values()) and all(jpeg.values())

    peer.spin_until(complete, "debug images")
    for topic in topics:
        image = raw[topic][-1]
        assert image.encoding == "bgr8" and image.header.frame_id == "camera_optical"
        assert (image.width, image.height, image.step) == (208, 156, 624), (image.width, image.height)
        assert len(image.data) == image.step * image.height
        assert np.asarray(image.data).std() > 5, "a picture, not one colour"
        packed = jpeg[topic][-1]
        assert packed.format == "jpeg" and bytes(packed.data[:2]) == b"\xff\xd8"
        assert jpeg_size(bytes(packed.data)) == (WIDTH, HEIGHT)
        assert stamp_of(packed)[0] >= 1000


def jpeg_size(data):
    """Width and height from the frame header of a JPEG."""
    stream = io.BytesIO(data[2:])
    while True:
        marker, length = stream.read(2), int.from_bytes(stream.read(2), "big")
        if 0xC0 <= marker[1] <= 0xC2:
            body = stream.read(length - 2)
            return int.from_bytes(body[3:5], "big"), int.from_bytes(body[1:3], "big")
        stream.seek(length - 2, io.SEEK_CUR)


def parameter_takes_effect(peer):
    """A smaller debug image from the next frame on, and the event that tells of it."""
    events = peer.listen(ParameterEvent, "/parameter_events", 10)
    images = peer.listen(Image, "/tracker/debug/image")
    request = SetParameters.Request(parameters=[integer("debug.max_side", 64)])
    assert peer.call(SetParameters, "/tracker/set_parameters", request).results[0].successful
    after = peer.index

    def smaller():
        peer.follow(1)
        late = [i for i in images if stamp_of(i) > stamp_of(peer.message(after))]
        assert all(i.width == 64 for i in late), "from the next frame on"
        return late

    peer.spin_until(smaller, "smaller debug images")
    mine = lambda: [e for e in events if e.node == "/tracker" and e.changed_parameters[0].name == "debug.max_side"]
    peer.spin_until(mine, "the event of the change")


def bad_input():
    """Nothing of it changes the track, and each gives its line on /rosout."""
    peer = Peer()
    lines = peer.listen(Log, "/rosout", 100)
    peer.connect()
    peer.step()
    early = peer.trigger("restart")
    assert not early.success and "no target" in early.message, early
    peer.start()
    peer.follow(5)

    good = peer.message(peer.index)
    bad = []
    for change in [
        {"step": WIDTH * 3 - 1},
        {"width": 0, "height": 0, "step": 0, "data": b""},
        {"encoding": "rgb7"},
        {"height": HEIGHT + 1},
    ]:
        message = image_message(encode(peer.scene.rgb(peer.index), "rgb8"), "rgb8", 5000 + len(bad))
        for field, value in change.items():
            setattr(message, field, value)
        bad.append(message)

    def told(part):
        return any(line.name == "tracker" and part in line.msg for line in lines)

    parts = ["step of 959 bytes", "image of 0 x 0", "'rgb7' is not supported", "230400 bytes is shorter than 241 rows"]
    for message, part in zip(bad, parts):
        # Best effort: what is missed is sent again.
        def refused():
            peer.images.publish(message)
            return told(part)

        peer.spin_until(refused, f"a line with '{part}'")
    assert not any(stamp_of(t)[0] >= 1100 for t in peer.tracks), "no tracks for bad images"

    for box, part in [
        ((WIDTH + 100, 10, 40, 40), "lies outside the image"),
        ((10, 10, 0, 20), "too small"),
        ((10, 10, 500, 3), "box 500 x 3 at (10, 10) is too small"),
        ((10, 10, 260, 20), "too thin"),
        ((0, 0, WIDTH + 1, 100), "larger than the image"),
    ]:
        # A line of a kind is written once a second.
        peer.spin_until(lambda: peer.mark(*box) or told(part), f"a line with '{part}'")
    said = peer.follow(5)
    assert said.tracks[0].id == "0" and said.tracks[0].age == 10, said
    assert stamp_of(good)[0] < 1100
    peer.close()


def offline(folder):
    """The frames as a folder of PNG files beside what the node says of them, one frame after another."""
    hidden = range(25, 40)
    peer = Peer()
    peer.scene.hidden = hidden
    for index in range(60):
        with open(os.path.join(folder, f"{index:04}.png"), "wb") as file:
            file.write(png(peer.scene.rgb(index)))
    peer.connect()
    said = [peer.start()] + [peer.step() for _ in range(59)]
    assert any(t.tracks[0].state == 2 for t in said), "it is lost while it is hidden"
    with open(os.path.join(folder, "node.txt"), "w") as file:
        for track in (t.tracks[0] for t in said):
            print(track.center_x, track.center_y, track.size_x, track.size_y, track.state, file=file)
    peer.close()


def record(bag, count):
    """A recording of the scene, in which the target is hidden for a while; gives its times and messages."""
    scene = Scene()
    scene.hidden = range(count // 3, count // 2)
    recorded = []
    with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topic = writer.add_connection("/image", "sensor_msgs/msg/Image", typestore=get_typestore(Stores.ROS2_JAZZY))
        for index in range(count):
            message = image_message(scene.rgb(index), "rgb8", index)
            due = stamp_of(message)[0] * 1_000_000_000 + stamp_of(message)[1] + 5_000_000
            writer.write(topic, due, serialize_message(message))
            recorded.append((due, message))
    return recorded


def replay(folder, hurried):
    """A recording played to the node at its own pace, or that of a slow machine, but for the last images, which follow each
    other at once. Leaves the recording, one of the images that the node looked at, and what it said of them."""
    folder, hurried = Path(folder), int(hurried)
    record(folder / "recorded", 90)
    with AnyReader([folder / "recorded"]) as reader:
        recorded = [(due, deserialize_message(bytes(data), Image)) for _, due, data in reader.messages()]
    peer = Peer()
    # The image that is sent until it is answered is none of the recording, for that must not come twice.
    peer.index = -1
    peer.connect()
    peer.index = 0
    peer.send(recorded[0][1])
    peer.start()

    # An image that is missed stays lost.
    answered = lambda image: any(stamp_of(t) == stamp_of(image) for t in peer.tracks)
    began, last = time.monotonic() - recorded[0][0] * 1e-9, recorded[0][1]
    for number, (due, image) in enumerate(recorded[1:], 1):
        if number < len(recorded) - hurried:
            peer.spin_for(lambda: answered(last), AGAIN)
            peer.spin_for(lambda: time.monotonic() >= began + due * 1e-9, AGAIN)
        peer.images.publish(image)
        last = image
    # The node never skips the newest.
    peer.spin_for(lambda: answered(last), AGAIN)
    said = {stamp_of(t): t.tracks[0] for t in peer.tracks if t.tracks}
    assert len(said) == sum(bool(t.tracks) for t in peer.tracks), "no image is looked at twice"
    peer.close()

    with Writer(folder / "seen", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topic = writer.add_connection("/image", "sensor_msgs/msg/Image", typestore=get_typestore(Stores.ROS2_JAZZY))
        with open(folder / "node.txt", "w") as file:
            for number, (due, image) in enumerate(recorded):
                if track := said.pop(stamp_of(image), None):
                    writer.write(topic, due, serialize_message(image))
                    box = track.center_x, track.center_y, track.size_x, track.size_y, track.state
                    print(number, *box, file=file)
    assert not said, "the node says nothing of images that were not sent"


def png(rgb):
    """The bytes of a PNG file."""

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    height, width, _ = rgb.shape
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    rows = b"".join(b"\0" + row.tobytes() for row in rgb)
    chunks = [chunk(b"IHDR", header), chunk(b"IDAT", zlib.compress(rows, 1)), chunk(b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


def measure(seconds):
    """A camera of 1280 x 720 at 30 Hz; prints what was lost and how long it took."""
    peer = Peer()
    peer.scene = Scene(1280, 720, (60, 120))
    # Made beforehand, and used in a ring that has no jump in it.
    count = round(2 * np.pi * 20)
    ring = [peer.message(index) for index in range(count)]
    peer.connect()
    peer.start()
    arrived = {}
    said = []

    def note(message):
        arrived[stamp_of(message)] = time.monotonic()
        said.append(message)

    peer.node.create_subscription(TrackArray, "/tracker/tracks", note, 1000)
    peer.spin_until(lambda: peer.node.count_subscribers("/tracker/tracks") == 2, "the second listener")
    for index in range(1, 31):
        peer.send(image_message(peer.scene.rgb(index), "rgb8", index))
    peer.spin_until(lambda: len(said) == 30, "the second listener hears all")
    said.clear()

    published, began = {}, time.monotonic()
    frames = round(30 * float(seconds))
    for n in range(frames):
        while (left := began + n / 30 - time.monotonic()) > 0:
            peer.executor.spin_once(timeout_sec=left)
        index = 31 + n
        message = stamped(ring[index % count], index)
        before = time.monotonic()
        peer.images.publish(message)
        published[stamp_of(message)] = before, time.monotonic()
    end = time.monotonic() + 1
    while time.monotonic() < end and len(said) < frames:
        peer.executor.spin_once(timeout_sec=0.05)

    stamps = [stamp_of(t) for t in said]
    foreign = [s for s in stamps if s not in published]
    processing = {stamp_of(t): t.processing_time.sec + t.processing_time.nanosec * 1e-9 for t in said}
    known = [s for s in stamps if s in published]

    def row(name, values):
        low, half, high = np.percentile(np.array(values) * 1e3, [5, 50, 95])
        print(f"{name}: 5 % {low:.2f} ms, median {half:.2f} ms, 95 % {high:.2f} ms")

    print(f"images sent: {frames}; track messages: {len(said)}; skipped by the tracker: {sum(t.skipped for t in said)}")
    print(f"messages with a stamp that no image had: {len(foreign)}; stamps twice: {len(stamps) - len(set(stamps))}")
    states = [t.tracks[0].state for t in said]
    print(f"tracking {states.count(0)}, uncertain {states.count(1)}, lost {states.count(2)}")
    row("publish() of the image", [after - before for before, after in published.values()])
    row("the tracker's own time", list(processing.values()))
    row("from publish() begun to the message in rclpy, without it", [arrived[s] - published[s][0] - processing[s] for s in known])
    row("from publish() returned to the message in rclpy, without it", [arrived[s] - published[s][1] - processing[s] for s in known])
    assert not foreign


def renamed():
    """Every name as the arguments of the node say; rows with padding."""
    peer = Peer(tracker="/robot/front/eye", image="/camera/image_raw", image_qos=10)
    peer.spin_until(lambda: "/robot/front/eye" in peer.listed(), "the renamed node is listed")
    peer.spin_until(lambda: peer.images.get_subscription_count(), "the remapped image topic")
    boxes = peer.listen(TrackArray, "/robot/boxes", 10)
    message = image_message(encode(peer.scene.rgb(0), "rgb8"), "rgb8", 0, padding=13)

    def answered():
        peer.images.publish(message)
        return boxes

    peer.spin_until(answered, "tracks on the remapped topic")
    request = GetParameters.Request(names=["seed", "debug.max_side", "debug.jpeg_quality"])
    values = peer.call(GetParameters, "/robot/front/eye/get_parameters", request).values
    assert [v.integer_value for v in values] == [11, 100, 77], values
    assert peer.call(Trigger, "/robot/halt").success
    peer.close()


def diagnostics():
    """Once a second, the counts of images and the states of targets; what goes wrong is a warning."""
    ticks = Ticks()
    peer = Peer()
    told = peer.listen(DiagnosticArray, "/diagnostics", 10)

    def latest(part):
        status = next((s for m in told[::-1] for s in m.status if s.name == f"tracker: {part}"), None)
        return status and (status.level, status.message, {v.key: v.value for v in status.values})

    peer.spin_until(lambda: latest("images"), "diagnostics")
    assert latest("images")[:2] == (b"\x01", "no image on /image"), latest("images")
    assert latest("targets")[:2] == (b"\x00", "no target"), latest("targets")
    assert int(latest("network")[2]["receive buffer limit (bytes)"]) > 0
    peer.connect()
    peer.start()

    def healthy():
        peer.follow(1)
        level, _, values = latest("images")
        return level == b"\x00" and int(values["received"]) > 5 and latest("targets")[1] == "1 tracking"

    peer.spin_until(healthy, "an image rate and a target")
    _, _, values = latest("images")
    assert float(values["rate (Hz)"]) > 0 and values["refused"] == "0", values
    _, _, values = latest("targets")
    assert values["tracking"] == "1", values
    shortest, mean, longest = map(float, values["latency, min / mean / max (ms)"].split(" / "))
    # The node's own thread may be stopped between the message and the look at the clock.
    assert 0 < shortest <= mean <= longest < 2e3 * peer.longest, (values, peer.longest)

    broken = peer.message(peer.index)
    broken.step -= 1

    def refused():
        peer.images.publish(broken)
        peer.executor.spin_once(timeout_sec=0.1)
        return latest("images")[0] == b"\x01" and "refused" in latest("images")[1]

    peer.spin_until(refused, "a warning of refused images")
    peer.spin_until(lambda: len(told) > 5, "some more")
    gaps = np.diff([m.header.stamp.sec + m.header.stamp.nanosec * 1e-9 for m in told])
    # Who wants to do something once a second on this machine, now, does it so.
    here = np.median(ticks.gaps())
    assert 0.7 < np.median(gaps) < 1.3 * here, (gaps, here)
    peer.close()


class Ticks(threading.Thread):
    """Notes the time once a second."""

    def __init__(self):
        super().__init__(daemon=True)
        self.times = [time.time()]
        self.start()

    def run(self):
        while True:
            time.sleep(max(self.times[0] + len(self.times) - time.time(), 0))
            self.times.append(time.time())

    def gaps(self):
        return np.diff(self.times)


def mismatched():
    """Publishers whose images the node, which asks for reliable ones, cannot have; its log tells why."""
    peer = Peer()
    lines = peer.listen(Log, "/rosout", 100)
    peer.node.create_publisher(Image, "/camera/image_raw", 10)
    # The node tells it once, maybe before it has seen who is there: it tells it anew after one who matches has left.
    matching = peer.node.create_publisher(Image, "/image", 10)
    peer.spin_until(lambda: matching.publish(peer.message(0)) or peer.tracks, "tracks of an image")
    peer.node.destroy_publisher(matching)
    told = lambda: any("no image on /image" in line.msg and "/camera/image_raw" in line.msg for line in lines)
    peer.spin_until(lambda: peer.images.publish(peer.message(0)) or told(), "the line on /rosout")
    peer.close()


def debug_share(frames, least):
    """At 1280 x 720, default subscribers (reliable, of depth 10) and sensor-data ones see nearly all debug images, if the
    camera waits for them."""
    frames, least = int(frames), float(least)
    peer, send, got = debug_camera()
    seen = [set() for _ in got]

    def arrived(stamp):
        for stamps, images in zip(seen, got):
            stamps.update(map(stamp_of, images))
            images.clear()
        return all(stamp in stamps for stamps in seen)

    stamps, missed = [], 0
    while len(stamps) < frames and missed <= (1 - least) * frames:
        stamps.append(send())
        missed += not peer.spin_for(lambda: arrived(stamps[-1]), AGAIN)
    counts = [sum(stamp in got for stamp in stamps) for got in seen]
    print(f"{len(stamps)} frames: {len(peer.tracks)} tracks, debug images {counts}")
    assert len(stamps) == frames and min(counts) >= least * frames, counts
    peer.close()


def debug_rate(seconds):
    """The same at 30 Hz, whether they have come or not; prints how many have."""
    peer, send, got = debug_camera()
    for images in [*got, peer.tracks]:
        images.clear()
    frames, begun = round(30 * float(seconds)), time.monotonic()
    for n in range(frames):
        send()
        while (left := begun + (n + 1) / 30 - time.monotonic()) > 0:
            peer.executor.spin_once(timeout_sec=left)
    took = time.monotonic() - begun
    peer.spin_for(lambda: False, 1)
    print(f"{frames} frames in {took:.1f} s: {len(peer.tracks)} tracks, debug images {[len(images) for images in got]}")
    peer.close()


def debug_camera():
    """A peer with a target in 1280 x 720 that is followed, what sends its next image and gives the stamp, and three lists of
    debug images, of which some have come."""
    peer = Peer()
    peer.scene = Scene(1280, 720, (80, 100))
    ring = [peer.message(index) for index in range(90)]
    peer.connect()
    peer.start()
    topics = [("image", Image, 10), ("image/compressed", CompressedImage, 10)]
    topics += [("image/compressed", CompressedImage, qos_profile_sensor_data)]
    got = [peer.listen(kind, f"/tracker/debug/{name}", qos) for name, kind, qos in topics]
    index = 0

    def send():
        nonlocal index
        index += 1
        turn = index % (2 * len(ring) - 2)
        message = stamped(ring[min(turn, 2 * len(ring) - 2 - turn)], index)
        peer.images.publish(message)
        return stamp_of(message)

    def everywhere():
        send()
        peer.executor.spin_once(timeout_sec=0.03)
        return all(got)

    peer.spin_until(everywhere, "debug images everywhere")
    return peer, send, got


def look():
    """Subscribes to compressed debug images and tells when the first has come; then goes on until it is killed."""
    peer = Peer(name="looker")
    images = peer.listen(CompressedImage, "/tracker/debug/image/compressed", 10)
    peer.spin_until(lambda: images, "a debug image")
    print("seen", flush=True)
    while True:
        peer.executor.spin_once(timeout_sec=1)
        images.clear()


def stuck_looker(node_pid):
    """A subscriber of debug images that stands still holds up nothing, and the node keeps nothing for it."""
    peer = Peer()
    peer.connect()
    peer.start()
    looker = child([sys.executable, __file__, "look"], stdout=subprocess.PIPE)
    try:
        said = []
        reads = threading.Thread(target=lambda: said.append(looker.stdout.readline()))
        reads.start()
        while reads.is_alive():
            peer.follow(1)
        assert said == [b"seen\n"], "it has ended"
        looker.send_signal(signal.SIGSTOP)
        peer.follow(100)
        sizes = [resident(node_pid)]
        for _ in range(4):
            said = peer.follow(150)
            sizes.append(resident(node_pid))
        # The allocator may take a step at any time; what is kept for the looker, 7 KB an image or more, grows in each window.
        assert min(np.diff(sizes)) < 1 and said.skipped == 0, (sizes, said.skipped)
    finally:
        looker.kill()
        looker.wait()
    peer.close()


class There:
    """A camera of 640 x 480, in whose images the target goes there and back again, so that it never jumps."""

    def __init__(self):
        self.peer = Peer()
        self.peer.scene = Scene(640, 480, (64, 80))
        self.ring = [self.peer.message(index) for index in range(256)]

    def turn(self, index):
        turn = index % (2 * len(self.ring) - 2)
        return min(turn, 2 * len(self.ring) - 2 - turn)

    def message(self, index):
        return stamped(self.ring[self.turn(index)], index)

    def box(self, index):
        return self.peer.scene.box(self.turn(index))


def first_track(times):
    """Adds to a file how long after the first image the first track came, in seconds of an idle machine."""
    camera = There()
    peer = camera.peer
    peer.spin_until(lambda: peer.images.get_subscription_count() and peer.marks.get_subscription_count(), "the node")
    begun, marks = time.monotonic(), 0

    def followed():
        nonlocal marks
        # What is sent before all is matched may be lost. Each mark is work, which may wait for a long time: fewer and fewer.
        if time.monotonic() >= begun + (2**marks - 1) / 2:
            peer.mark(*camera.box(0))
            marks += 1
        peer.images.publish(camera.message(0))
        return next((t for t in peer.tracks if t.tracks), None)

    peer.spin_until(followed, "the first track")
    with open(times, "a") as file:
        print((time.monotonic() - begun) / slowness(), file=file)
    peer.close()


def endurance(node_pid, frames):
    """Follows a target through so many frames, one after the other; prints and checks the node's resident memory."""
    camera, frames, sizes = There(), int(frames), []
    peer = camera.peer
    peer.connect()
    peer.start()
    for index in range(1, frames + 1):
        said = peer.send(camera.message(index))
        peer.detections.clear()
        sizes.append(resident(node_pid))
    assert iou(box_of(said.tracks[0]), camera.box(frames)) > 0.5, said
    # The first fifth fills caches and the memory of samples. What is on its way at a time is in no window's least.
    windows = [float(min(window)) for window in np.array_split(sizes, 5)]
    print(f"{frames} frames; resident {windows} MB at least, {max(sizes)} MB at most")
    # The allocator may take a step at any time; what is kept grows in each window.
    assert max(sizes) < 200 and min(np.diff(windows[1:])) < 0.75, (windows, max(sizes))
    peer.close()


if __name__ == "__main__":
    run(globals()[sys.argv[1]], *sys.argv[2:])
