"""The independent reader and writer of bags; see `tests/bags.rs`, which runs `bags.py NAME [ARGUMENT]...`."""

import sys
from pathlib import Path

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

STORE = get_typestore(Stores.ROS2_JAZZY)
IMAGE, COMPRESSED, STRING = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage", "std_msgs/msg/String"
# Nanoseconds: of the first image, from one to the next, and from the image to its recording.
START, PERIOD, DELAY = 1_700_000_000_000_000_000, 33_333_333, 5_000_000
BAGS = {
    "mcap": (StoragePlugin.MCAP, CompressionMode.NONE),
    "mcap_zstd": (StoragePlugin.MCAP, CompressionMode.STORAGE),
    "mcap_message": (StoragePlugin.MCAP, CompressionMode.MESSAGE),
    "sqlite": (StoragePlugin.SQLITE3, CompressionMode.NONE),
    "sqlite_message": (StoragePlugin.SQLITE3, CompressionMode.MESSAGE),
}


def header(number):
    """That of an image: its stamp is earlier than the time of its recording."""
    sec, nanosec = divmod(START + number * PERIOD, 1_000_000_000)
    stamp = STORE.types["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
    return STORE.types["std_msgs/msg/Header"](stamp=stamp, frame_id="camera_optical")


def image(number, pixels, size):
    width, height = size
    make = STORE.types[IMAGE]
    return make(header(number), height, width, "rgb8", 0, 3 * width, np.frombuffer(pixels, dtype=np.uint8))


def compressed(number, data, kind):
    return STORE.types[COMPRESSED](header(number), kind, np.frombuffer(data, dtype=np.uint8))


def write(images, out, width, height):
    """Bags of every kind of the files `raw/N.rgb`, `jpg/N.jpg` and `png/N.png` below `images`. Neighbours are written in
    the wrong order, with the right times."""
    images, size = Path(images), (int(width), int(height))
    count = len(list((images / "raw").iterdir()))
    order = [n ^ 1 if n ^ 1 < count else n for n in range(count)]
    for name, (storage, compression) in BAGS.items():
        writer = Writer(Path(out) / name, version=9, storage_plugin=storage)
        if compression != CompressionMode.NONE:
            writer.set_compression(compression, CompressionFormat.ZSTD)
        with writer:
            add = lambda topic, kind: writer.add_connection(topic, kind, typestore=STORE)
            raw, jpeg = add("/camera/raw", IMAGE), add("/camera/raw/compressed", COMPRESSED)
            png, other = add("/camera/png/compressed", COMPRESSED), add("/chatter", STRING)
            for n in order:
                read = lambda kind, ending: (images / kind / f"{n}.{ending}").read_bytes()
                for topic, message in [
                    (raw, image(n, read("raw", "rgb"), size)),
                    (jpeg, compressed(n, read("jpg", "jpg"), "rgb8; jpeg compressed bgr8")),
                    (png, compressed(n, read("png", "png"), "rgb8; png compressed bgr8")),
                    (other, STORE.types[STRING](data=f"{n}")),
                ]:
                    data = STORE.serialize_cdr(message, topic.msgtype)
                    writer.write(topic, START + n * PERIOD + DELAY, data)


def check(bag, rows, source, topic):
    """The bag that `track` wrote: it tells its types, bears the rows of the CSV, and the messages of `topic` are those of
    the source (`-`: it was a folder of images)."""
    lines = Path(rows).read_text().splitlines()[1:]
    rows = [(*map(float, line.split(",")[:5]), line.split(",")[5]) for line in lines]
    with AnyReader([Path(bag)]) as reader:
        known = {c.topic: c for c in reader.connections}
        types = {
            topic: COMPRESSED if topic.endswith("compressed") else IMAGE,
            "/tracker/tracks": "long_term_tracker/msg/TrackArray",
            "/tracker/detections": "vision_msgs/msg/Detection2DArray",
            "/tracker/annotations": "foxglove_msgs/msg/ImageAnnotations",
        }
        assert {c.topic: c.msgtype for c in reader.connections} == types
        for connection in reader.connections:
            check_definition(connection)
        got = {t: [] for t in known}
        for connection, time, data in reader.messages():
            got[connection.topic].append((time, data, reader.deserialize(data, connection.msgtype)))
    assert {t: len(m) for t, m in got.items()} == dict.fromkeys(types, len(rows))

    images = got[topic]
    if source != "-":
        with AnyReader([Path(source)]) as reader:
            there = [c for c in reader.connections if c.topic == topic]
            assert [(t, bytes(d)) for _, t, d in reader.messages(there)] == [(t, bytes(d)) for t, d, _ in images]
    for n, (x, y, w, h, confidence, state) in enumerate(rows):
        time, _, picture = images[n]
        (t1, _, tracks), (t2, _, detections), (t3, _, annotations) = (got[t][n] for t in list(types)[1:])
        assert t1 == t2 == t3 == time
        assert tracks.header == detections.header == picture.header, n
        assert tracks.algorithm == "lcmht" and tracks.skipped == 0
        assert 0 < tracks.processing_time.nanosec < 1_000_000_000
        (track,) = tracks.tracks
        assert (track.center_x, track.center_y, track.size_x, track.size_y) == (x + w / 2, y + h / 2, w, h), n
        assert (track.id, track.age) == ("0", n)
        assert track.confidence == np.float32(confidence)
        assert ["tracking", "uncertain", "lost"][track.state] == state
        assert len(detections.detections) == (state != "lost")
        for detection in detections.detections:
            assert (detection.bbox.center.position.x, detection.bbox.size_y) == (x + w / 2, h)
            assert detection.results[0].hypothesis.score == np.float32(confidence)
            assert detection.results[0].pose.pose.orientation.w == 1
        (outline,), (label,) = annotations.points, annotations.texts
        assert outline.timestamp == picture.header.stamp and outline.type == outline.LINE_LOOP
        assert [(p.x, p.y) for p in outline.points] == [(x, y), (x + w, y), (x + w, y + h), (x, y + h)]
        assert label.text.startswith(state), label


def check_definition(connection):
    """What the bag says of types that are known elsewhere is what is said there."""
    told = get_types_from_msg(connection.msgdef.data, connection.msgtype)
    foreign = [name for name in told if name in STORE.fielddefs]
    assert connection.msgtype.startswith("foxglove") or "std_msgs/msg/Header" in foreign
    for name in foreign:
        # Without default values, which change nothing in the bytes.
        assert told[name][1] == STORE.fielddefs[name][1], name


if __name__ == "__main__":
    globals()[sys.argv[1]](*sys.argv[2:])
