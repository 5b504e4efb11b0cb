"""The other side of the node in the tests: an rclpy process with a camera, a user and a listener.

Everything is awaited with a deadline; nothing sleeps for a fixed time. The camera sends an image once the last one is
answered, so that nothing depends on how fast the machine is.
"""

import time

import numpy as np
import rclpy
from long_term_tracker.msg import TrackArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import CompressedImage, Image, RegionOfInterest
from std_srvs.srv import Trigger
from vision_msgs.msg import Detection2D, Detection2DArray

from scene import *  # noqa: F403

# Seconds until something that must happen has to have happened. It only ends what hangs: nothing is judged by it.
DEADLINE = 120.0
# Seconds without an answer after which it is likelier that an image was lost than that its answer is on the way.
AGAIN = 30.0
# Seconds of processor time that are spent to see how long they take.
WORK = 0.1
CHANNELS = {"rgb8": 3, "bgr8": 3, "rgba8": 4, "bgra8": 4, "mono8": 1}


def encode(rgb, encoding):
    """The bytes of a picture, rows x columns x channels."""
    if encoding == "mono8":
        return (rgb.astype(np.uint16).sum(axis=2) // 3).astype(np.uint8)[:, :, None]
    order = rgb if encoding.startswith("rgb") else rgb[:, :, ::-1]
    if CHANNELS[encoding] == 4:
        alpha = np.full((*order.shape[:2], 1), 255, dtype=np.uint8)
        order = np.concatenate([order, alpha], axis=2)
    return order


def stamped(message, index):
    """The stamp that tells frames apart: 30 a second from second 1000 on."""
    nanos = 1_000_000_000_000 + index * 33_333_333
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(nanos, 1_000_000_000)
    message.header.frame_id = "camera_optical"
    return message


def image_message(picture, encoding, index, padding=0):
    """An image whose rows are followed by bytes that mean nothing."""
    height, width, channels = picture.shape
    step = width * channels + padding
    rows = np.zeros((height, step), dtype=np.uint8)
    rows[:, : width * channels] = picture.reshape(height, -1)
    message = Image(height=height, width=width, encoding=encoding, step=step)
    message.data.frombytes(rows.tobytes())
    return stamped(message, index)


def stamp_of(message):
    return message.header.stamp.sec, message.header.stamp.nanosec


def slowness():
    """How many times its processor time a thread takes at present: 1 on an idle machine, about N/C where N threads want to
    run on C processors."""
    begun, spent = time.monotonic(), time.thread_time()
    while time.thread_time() - spent < WORK:
        pass
    return max((time.monotonic() - begun) / WORK, 1.0)


class Peer:
    """A node with all that talks to the tracker."""

    def __init__(self, tracker="/tracker", image="/image", name="peer", image_qos=qos_profile_sensor_data, image_type=Image):
        rclpy.init(args=[])
        self.node = rclpy.create_node(name)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.tracker = tracker
        self.tracks, self.detections = [], []
        self.images = self.node.create_publisher(image_type, image, image_qos)
        self.marks = self.node.create_publisher(RegionOfInterest, f"{tracker}/init_roi", 10)
        depth = QoSProfile(depth=1000)
        self.node.create_subscription(TrackArray, f"{tracker}/tracks", self.tracks.append, depth)
        self.node.create_subscription(Detection2DArray, f"{tracker}/detections", self.detections.append, depth)
        self.scene = Scene()
        self.index = 0
        # When the newest image was first sent; seconds from there to its answer, and the most of any image.
        self.sent, self.took, self.longest = None, 0.0, 0.0

    def close(self):
        self.node.destroy_node()
        rclpy.shutdown()

    def spin_until(self, condition, what, deadline=DEADLINE):
        """Spins until the condition gives something, and gives that."""
        result = self.spin_for(condition, deadline)
        assert result, f"{what}: not within {deadline} s"
        return result

    def spin_for(self, condition, seconds):
        """Spins until the condition gives something, or for so long; gives what it gave."""
        end = time.monotonic() + seconds
        while not (result := condition()) and (left := end - time.monotonic()) > 0:
            self.executor.spin_once(timeout_sec=min(left, 0.1))
        return result

    def listed(self):
        """Full names of all nodes that are seen."""
        return [f"{ns.rstrip('/')}/{name}" for name, ns in self.node.get_node_names_and_namespaces()]

    def message(self, index, encoding="rgb8"):
        return image_message(encode(self.scene.rgb(index), encoding), encoding, index)

    def connect(self):
        """Sends the first frame with the stamp before its own until it is answered, for what is sent before all is matched
        may be lost; then the frame itself, after whose answer none of those comes any more."""
        self.spin_until(
            lambda: self.images.get_subscription_count() and self.marks.get_subscription_count(), "subscriptions"
        )
        message, began = stamped(self.message(self.index), self.index - 1), time.monotonic()

        def greeted():
            self.images.publish(message)
            return self.tracks

        self.spin_until(greeted, "a track message for the first images")
        self.send(self.message(self.index))
        self.tracks.clear()
        self.longest = time.monotonic() - began

    def send(self, message, meanwhile=lambda: None):
        """Publishes an image and waits for its track message, and does something else each time nothing has come yet. Best
        effort as it is, the image may be lost: then it is sent again."""
        self.tracks.clear()
        self.sent, stamp = time.monotonic(), stamp_of(message)
        answer = lambda: next((t for t in self.tracks if stamp_of(t) == stamp), None) or meanwhile()
        while True:
            self.images.publish(message)
            if said := self.spin_for(answer, AGAIN):
                return self.answered(said)
            assert time.monotonic() < self.sent + DEADLINE, f"tracks of image {stamp}: not within {DEADLINE} s"

    def answered(self, said):
        """Notes how long it took since the newest image was sent."""
        self.took = time.monotonic() - self.sent
        self.longest = max(self.longest, self.took)
        return said

    def step(self, encoding="rgb8"):
        """Sends the next frame of the scene; gives its tracks."""
        self.index += 1
        return self.send(self.message(self.index, encoding))

    def mark(self, x, y, width, height):
        self.marks.publish(RegionOfInterest(x_offset=x, y_offset=y, width=width, height=height))

    def start(self):
        """Marks the target of the newest frame and waits until it is followed."""
        self.tracks.clear()
        self.mark(*self.scene.box(self.index))
        return self.answered(self.spin_until(lambda: next((t for t in self.tracks if t.tracks), None), "the start"))

    def follow(self, frames, encoding="rgb8", least=0.5):
        """Sends frames and checks that the target is where it is said to be."""
        for _ in range(frames):
            said = self.step(encoding)
            assert len(said.tracks) == 1, said
            overlap = iou(box_of(said.tracks[0]), self.scene.box(self.index))
            assert overlap >= least, f"frame {self.index}: overlap {overlap:.2f}, {said.tracks[0]}"
        return said

    def call(self, kind, name, request=None):
        client = self.node.create_client(kind, name)
        self.spin_until(client.service_is_ready, f"service {name}")
        future = client.call_async(request or kind.Request())
        self.spin_until(future.done, f"answer of {name}")
        self.node.destroy_client(client)
        return future.result()

    def trigger(self, name):
        return self.call(Trigger, f"{self.tracker}/{name}")

    def listen(self, kind, topic, qos=qos_profile_sensor_data):
        """A list that fills with what comes on the topic."""
        got = []
        self.node.create_subscription(kind, topic, got.append, qos)
        return got


__all__ = [name for name in dir() if not name.startswith("_")]
