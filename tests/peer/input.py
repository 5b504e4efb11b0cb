"""What comes into the node: encodings, compressed images, marks on frames that have passed, streams that change; part of
`scenarios.py`."""

import io

import numpy as np
from peer import *  # noqa: F403
from PIL import Image as Picture
from rcl_interfaces.msg import Log

# Named as in sensor_msgs/image_encodings. A `>` asks for the high byte first; it is no part of the name.
GREY = ["mono8", "8UC1", "mono16", "16UC1", "mono16>", "16UC1>"]
COLOUR = ["rgb8", "bgr8", "rgba8", "bgra8", "8UC3", "8UC4", "yuv422", "uyvy", "yuv422_yuy2", "yuyv", "nv12", "nv21"]
COLOUR += ["bayer_rggb8", "bayer_bggr8", "bayer_gbrg8", "bayer_grbg8"]


def grey_of(rgb):
    return (rgb.astype(np.uint16).sum(axis=2) // 3).astype(np.uint8)


def yuv_of(rgb):
    """BT.601 in the range of video."""
    matrix = np.array([[65.738, 129.057, 25.064], [-37.945, -74.494, 112.439], [112.439, -94.154, -18.285]]) / 256
    return rgb @ matrix.T + [16, 128, 128]


def rows_of(rgb, encoding):
    """The bytes of a picture, row by row."""
    height, width, _ = rgb.shape
    name = encoding.rstrip(">")
    if name in ("mono8", "8UC1"):
        return grey_of(rgb)
    if name in ("mono16", "16UC1"):
        deep = (grey_of(rgb).astype(np.uint16) * 257).astype(">u2" if encoding.endswith(">") else "<u2")
        return deep.view(np.uint8)
    if name.startswith("bayer"):
        sites = {"r": 0, "g": 1, "b": 2}
        rows = np.empty((height, width), dtype=np.uint8)
        for place, letter in enumerate(name[6:10]):
            down, across = divmod(place, 2)
            rows[down::2, across::2] = rgb[down::2, across::2, sites[letter]]
        return rows
    if name in ("yuv422", "uyvy", "yuv422_yuy2", "yuyv"):
        luma, *chroma = np.moveaxis(yuv_of(rgb), 2, 0)
        u, v = ((c[:, ::2] + c[:, 1::2]) / 2 for c in chroma)
        first, second = luma[:, ::2], luma[:, 1::2]
        order = (u, first, v, second) if name in ("yuv422", "uyvy") else (first, u, second, v)
        return np.round(np.stack(order, axis=2)).astype(np.uint8).reshape(height, -1)
    if name in ("nv12", "nv21"):
        luma, *chroma = np.moveaxis(yuv_of(rgb), 2, 0)
        pairs = [(c[::2, ::2] + c[1::2, ::2] + c[::2, 1::2] + c[1::2, 1::2]) / 4 for c in chroma]
        below = np.stack(pairs if name == "nv12" else pairs[::-1], axis=2).reshape(height // 2, width)
        return np.round(np.concatenate([luma, below])).astype(np.uint8)
    order = rgb if name.startswith("rgb") else rgb[:, :, ::-1]
    if name in ("rgba8", "bgra8", "8UC4"):
        order = np.concatenate([order, np.full((height, width, 1), 255, dtype=np.uint8)], axis=2)
    return order.reshape(height, -1)


def encoded(rgb, encoding, index, padding=0):
    """A message in any encoding, its rows followed by bytes that mean nothing."""
    rows = rows_of(rgb, encoding)
    rows = np.pad(rows, ((0, 0), (0, padding)), constant_values=123)
    height, width, _ = rgb.shape
    message = Image(height=height, width=width, encoding=encoding.rstrip(">"), step=rows.shape[1])
    message.is_bigendian = int(encoding.endswith(">"))
    message.data.frombytes(rows.tobytes())
    return stamped(message, index)


class Camera(Peer):
    """A peer whose frames bear any encoding or size, and may be JPEG or PNG."""

    encoding, padding, zoom = "rgb8", 0, (1, 1)

    def rgb(self, index):
        across, down = self.zoom
        return np.kron(self.scene.rgb(index), np.ones((down, across, 1), dtype=np.uint8))

    def message(self, index, encoding=None):
        return encoded(self.rgb(index), encoding or self.encoding, index, self.padding)

    def seen(self):
        """Where the target is in the newest frame."""
        x, y, w, h = self.scene.box(self.index)
        across, down = self.zoom
        return x * across, y * down, w * across, h * down

    def begin(self):
        self.tracks.clear()
        self.mark(*self.seen())
        return self.answered(self.spin_until(lambda: next((t for t in self.tracks if t.tracks), None), "the start"))

    def keep_up(self, frames, least=0.5):
        """Sends frames; the target is where it is said to be."""
        for _ in range(frames):
            self.index += 1
            said = self.send(self.message(self.index))
            assert len(said.tracks) == 1, said
            overlap = iou(box_of(said.tracks[0]), self.seen())
            what = f"{self.encoding}, frame {self.index}: overlap {overlap:.2f}, {said.tracks[0]}"
            assert overlap >= least, what
        return said

    def rosout(self):
        lines = self.listen(Log, "/rosout", 100)
        return lambda part: [line.msg for line in lines if part in line.msg]


def encodings():
    """The same scene in every encoding, and what the debug image shows of it. The first mark comes before any image, and
    waits for one."""
    camera = Camera()
    told = camera.rosout()
    # What is sent before the node has matched the writer is lost, and only the node's log tells that it has.
    early = lambda: camera.mark(*camera.scene.box(0)) or told("waits for the first image")
    camera.spin_until(early, "a line of the early mark")
    camera.connect()
    camera.keep_up(3)
    shown = camera.listen(Image, "/tracker/debug/image")
    for number, encoding in enumerate(GREY + COLOUR):
        camera.encoding, camera.padding = encoding, 7 * (number % 2)
        camera.index += 1
        camera.send(camera.message(camera.index))
        camera.begin()
        said = camera.keep_up(8)
        assert said.tracks[0].state == 0, (encoding, said)
        since = stamp_of(camera.message(camera.index))

        def drawn():
            camera.keep_up(1)
            return next((s for s in shown if stamp_of(s) > since), None)

        picture = camera.spin_until(drawn, f"a debug image of {encoding}")
        alike = likeness(picture, camera)
        assert alike > 0.75, f"{encoding}: the debug image resembles the scene by {alike}"
    camera.close()


def likeness(shown, camera):
    """The share of a bgr8 image that shows the scene's background in its colours; the rest is the target and what is
    drawn."""
    size = shown.width, shown.height
    shown = np.frombuffer(bytes(shown.data), dtype=np.uint8).reshape(shown.height, shown.width, 3)[:, :, ::-1]
    scene = camera.scene.background
    scene = scene if camera.encoding in COLOUR else np.repeat(grey_of(scene)[:, :, None], 3, axis=2)
    scene = np.asarray(Picture.fromarray(scene).resize(size, Picture.Resampling.BOX))
    return float((np.abs(shown.astype(int) - scene) < 20).all(axis=2).mean())


def packed(rgb, kind, format, index):
    """A compressed image as image_transport sends it: the compressor, which takes blue first, is given the picture."""
    data = io.BytesIO()
    if format.endswith("compressed rgb8"):
        rgb = rgb[:, :, ::-1]
    if format.startswith(("mono16", "16UC1")):
        picture = Picture.fromarray(grey_of(rgb).astype(np.uint16) * 257)
    elif format.startswith("bayer"):
        picture = Picture.fromarray(rows_of(rgb, format.split(";")[0]))
    else:
        picture = Picture.fromarray(grey_of(rgb) if format.startswith("mono8") else rgb)
    picture.save(data, kind, **({"quality": 95} if kind == "jpeg" else {"compress_level": 1}))
    message = CompressedImage(format=format)
    message.data.frombytes(data.getvalue())
    return stamped(message, index)


FORMATS = [
    ("jpeg", "bgr8; jpeg compressed bgr8"),
    ("jpeg", "rgb8; jpeg compressed bgr8"),
    ("jpeg", "rgb8; jpeg compressed rgb8"),
    ("jpeg", "mono8; jpeg compressed "),
    ("jpeg", "jpeg"),
    ("jpeg", "jpg"),
    ("png", "rgb8; png compressed bgr8"),
    ("png", "mono8; png compressed "),
    ("png", "16UC1; png compressed "),
    ("png", "bayer_grbg8; png compressed "),
    ("png", "png"),
]


class Packer(Camera):
    """A peer that sends compressed images."""

    kind, format = FORMATS[0]

    def message(self, index, encoding=None):
        return packed(self.rgb(index), self.kind, self.format, index)


def compressed():
    """Each format of image_transport is tracked, in its colours; what is broken is told, and the node goes on."""
    camera = Packer(image="/camera/image_raw/compressed", image_type=CompressedImage)
    told = camera.rosout()
    camera.connect()
    camera.begin()
    shown = camera.listen(Image, "/tracker/debug/image")
    for kind, format in FORMATS:
        camera.kind, camera.format = kind, format
        camera.encoding = "mono8" if format.startswith(("mono", "16UC1")) else "rgb8"
        camera.index += 1
        camera.send(camera.message(camera.index))
        camera.begin()
        camera.keep_up(4)
        since = stamp_of(camera.message(camera.index))

        def drawn():
            camera.keep_up(1)
            return next((s for s in shown if stamp_of(s) > since), None)

        alike = likeness(camera.spin_until(drawn, f"a debug image of {format}"), camera)
        assert alike > 0.75, f"{format}: the debug image resembles the scene by {alike}"

    whole = camera.message(5000)
    cut = CompressedImage(header=whole.header, format=whole.format, data=whole.data[: len(whole.data) // 2])
    depth = CompressedImage(header=whole.header, format="16UC1; compressedDepth png", data=bytes(12) + bytes(whole.data))
    odd = packed(camera.scene.rgb(0)[1:], "png", "bayer_rggb8; png compressed ", 5000)
    for message, part in [
        (cut, "image refused: cannot be decoded: "),
        (depth, "neither JPEG nor PNG (format '16UC1; compressedDepth png')"),
        (odd, "cannot be bayer_rggb8"),
    ]:
        # More than one a second of a kind is held back, and best effort may lose some.
        def refused():
            camera.images.publish(message)
            camera.executor.spin_once(timeout_sec=0.1)
            return told(part)

        camera.spin_until(refused, f"a line with '{part}'")
    age = camera.keep_up(3).tracks[0].age
    assert age > 3, "the target goes on"
    for _ in range(10):
        camera.images.publish(cut)
    camera.spin_until(lambda: [line for line in told("image refused") if "more like it" in line] or
                      camera.images.publish(cut), "a line that counts")
    camera.keep_up(3)
    assert all(stamp_of(t)[0] < 1100 for t in camera.tracks), "no tracks for broken images"
    camera.close()


def detection_of(box, stamp=(0, 0), id="", theta=0.0):
    message = Detection2D(id=id)
    message.header.stamp.sec, message.header.stamp.nanosec = stamp
    x, y, w, h = map(float, box)
    message.bbox.center.position.x, message.bbox.center.position.y = x + w / 2, y + h / 2
    message.bbox.center.theta, message.bbox.size_x, message.bbox.size_y = theta, w, h
    return message


def named_marks():
    """A mark on `~/init_detection` starts on the frame that its header names, and catches up."""
    camera = Camera()
    told = camera.rosout()
    marks = camera.node.create_publisher(Detection2D, "/tracker/init_detection", 10)
    camera.spin_until(lambda: marks.get_subscription_count(), "the topic of detections")
    camera.connect()
    # Of the frames from here on the target is seen in the first three only: the box of a later one is of no use.
    camera.scene.hidden = range(4, 9)
    for _ in range(20):
        camera.index += 1
        assert camera.send(camera.message(camera.index)).tracks == []

    def started(message):
        camera.tracks.clear()
        marks.publish(message)
        return camera.spin_until(lambda: next((t for t in camera.tracks if t.tracks), None), "the start")

    stamp = lambda index: stamp_of(camera.message(index))
    said = started(detection_of(camera.scene.box(9), stamp(9), "person 7"))
    assert stamp_of(said) == stamp(20), "the track is told for the newest frame"
    track = said.tracks[0]
    assert (track.id, track.age) == ("person 7", 11), track
    assert iou(box_of(track), camera.scene.box(20)) > 0.6, track
    assert camera.spin_until(lambda: told("target person 7 marked"), "a line")[0].endswith(", 11 images ago")
    assert camera.keep_up(5).tracks[0].id == "person 7"
    # Without a stamp it is the newest; a box that is turned by a quarter has its sides exchanged.
    x, y, w, h = camera.scene.box(camera.index)
    turned = detection_of((x + (w - h) / 2, y - (w - h) / 2, h, w), id="turned", theta=np.pi / 2)
    track = started(turned).tracks[0]
    assert (track.id, track.age) == ("turned", 0) and iou(box_of(track), (x, y, w, h)) > 0.99, track

    # The frame that is named is still on its way.
    ahead = camera.index + 2
    camera.marks_sent = detection_of(camera.scene.box(ahead), stamp(ahead), "ahead")
    marks.publish(camera.marks_sent)
    camera.spin_until(lambda: told("waits for its image"), "a line")
    assert camera.keep_up(1).tracks[0].id == "turned"
    # Images win over marks: what is followed is told of the image first.
    camera.keep_up(1)
    track = camera.spin_until(lambda: next((t for m in camera.tracks for t in m.tracks if t.id == "ahead"), None), "it")
    assert track.age == 0, track

    oldest, newest = stamp(camera.index - 11), stamp(camera.index)
    text = lambda stamp: f"{stamp[0]}.{stamp[1]:09}"
    for wrong in [(999, 5), (1000, 5), (2000, 0)]:
        mark = detection_of(camera.scene.box(camera.index), wrong, "wrong")
        part = f"no image with stamp {text(wrong)} is kept: the 12 kept ones have stamps from {text(oldest)} to {text(newest)}"
        # A line of a kind is written once a second.
        camera.spin_until(lambda: marks.publish(mark) or told(part), f"a line with '{part}'")
    assert camera.keep_up(2).tracks[0].id == "ahead", "a refused mark changes nothing"
    marks.publish(detection_of((0, 0, 0, 0), id="nobody"))
    camera.spin_until(lambda: told("there was no target nobody"), "a line")
    marks.publish(detection_of((0, 0, 0, 0), id="ahead"))
    camera.spin_until(lambda: told("target ahead stopped"), "a line")
    camera.index += 1
    assert camera.send(camera.message(camera.index)).tracks == []
    camera.close()


def changing_stream():
    """Another size, another encoding, stamps that jump back and stamps of zero: the target is followed on."""
    camera = Camera()
    told = camera.rosout()
    camera.connect()
    camera.begin()
    camera.keep_up(10)
    camera.zoom = (2, 2)
    track = camera.keep_up(10, 0.6).tracks[0]
    assert track.age == 20 and 70 < track.size_x < 90, track
    assert camera.spin_until(lambda: told("images are now 640 x 480 rgb8, and were 320 x 240 rgb8"), "a line")
    camera.zoom = (1, 1)
    camera.encoding = "nv12"
    camera.keep_up(5)
    camera.encoding = "mono8"
    track = camera.keep_up(5).tracks[0]
    assert track.age == 30, track
    camera.encoding = "rgb8"
    camera.keep_up(3)

    # A recording that begins again: the stamps do, and here the target stands where it stood.
    index, shown = camera.index, camera.scene.box(camera.index)
    for again in range(1, 11):
        said = camera.send(encoded(camera.rgb(index + again), "rgb8", again))
        assert stamp_of(said)[0] == 1000 and iou(box_of(said.tracks[0]), camera.scene.box(index + again)) > 0.5, said
        assert abs(said.tracks[0].velocity_x) < 500, said
    camera.spin_until(lambda: told("image stamps jumped back by 1.067 s"), "a line")
    index += 10

    # No clock at all: velocities are in pixels a frame.
    for again in range(1, 20):
        message = encoded(camera.rgb(index + again), "rgb8", 0)
        message.header.stamp.sec, message.header.stamp.nanosec = 0, 0
        said = camera.send(message)
        assert iou(box_of(said.tracks[0]), camera.scene.box(index + again)) > 0.5, said
    assert shown != camera.scene.box(index + 19) and said.tracks[0].age == 62, said
    camera.close()
