"""What a peer can do that means no good; part of `scenarios.py`."""

import io
import itertools
import os
import time

from parameters import *  # noqa: F403
from PIL import Image as Picture
from peer import *  # noqa: F403
from sensor_msgs.msg import CompressedImage
from vision_msgs.msg import Detection2D


def bombs(folder):
    """Images that claim much among those of the scene: each of the latter that is waited for is answered."""
    peer = Peer(image="/camera/image_raw/compressed", image_type=CompressedImage)
    bad = []
    for name in sorted(os.listdir(folder)):
        message = CompressedImage(format=name)
        with open(os.path.join(folder, name), "rb") as file:
            message.data.frombytes(file.read())
        bad.append(stamped(message, 10**6))

    def good(index, encoding=None):
        data = io.BytesIO()
        Picture.fromarray(peer.scene.rgb(index)).save(data, "jpeg", quality=95)
        message = CompressedImage(format="rgb8; jpeg compressed bgr8")
        message.data.frombytes(data.getvalue())
        return stamped(message, index)

    peer.message = good
    peer.connect()
    peer.start()
    for index in range(1, 31):
        peer.images.publish(bad[index % len(bad)])
        message = good(index)
        peer.index = index

        # Best effort: what is missed is sent again.
        def answered():
            peer.images.publish(message)
            peer.executor.spin_once(timeout_sec=0.1)
            return any(stamp_of(t) == stamp_of(message) for t in peer.tracks)

        peer.spin_until(answered, f"tracks of image {index}")
    peer.close()


def nagging(seconds):
    """Parameters that are refused, some that are not, and marks on nothing, one after another for so long."""
    peer = Peer()
    peer.connect()
    client = Client(peer)
    detections = peer.node.create_publisher(Detection2D, "/tracker/init_detection", 10)
    peer.spin_until(detections.get_subscription_count, "the topic of detections")
    end = time.monotonic() + float(seconds)
    for n in itertools.takewhile(lambda _: time.monotonic() < end, itertools.count()):
        client.set(integer("debug.max_side", 1), integer("debug.max_side", 100 + n % 2))
        peer.mark(10, 10, 0, 20)
        detections.publish(Detection2D(id=100_000 * "x"))
    peer.step()
    peer.close()
