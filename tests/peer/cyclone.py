"""A peer of Cyclone DDS, which knows nothing of ROS: topics by their names on the wire, types as written here."""

import os
import time
from dataclasses import dataclass

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float32, float64, int32, sequence, uint8, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from scene import HEIGHT, WIDTH, Scene, box_of, iou
from script import run

# Seconds until something that must happen has to have happened, and after which an image is likely to have been lost.
DEADLINE, AGAIN = 120.0, 30.0
# On loopback only, where participants are looked for one by one as well, for it may not do multicast.
CONFIGURATION = """<CycloneDDS><Domain><General><Interfaces><NetworkInterface name="lo" multicast="true"/></Interfaces>
</General><Discovery><Peers><Peer address="127.0.0.1"/></Peers><ParticipantIndex>auto</ParticipantIndex></Discovery>
</Domain></CycloneDDS>"""


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Duration(IdlStruct, typename="builtin_interfaces::msg::dds_::Duration_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class Image(IdlStruct, typename="sensor_msgs::msg::dds_::Image_"):
    header: Header
    height: uint32
    width: uint32
    encoding: str
    is_bigendian: uint8
    step: uint32
    data: sequence[uint8]


@dataclass
class RegionOfInterest(IdlStruct, typename="sensor_msgs::msg::dds_::RegionOfInterest_"):
    x_offset: uint32
    y_offset: uint32
    height: uint32
    width: uint32
    do_rectify: bool


@dataclass
class Track(IdlStruct, typename="long_term_tracker::msg::dds_::Track_"):
    id: str
    state: uint8
    center_x: float64
    center_y: float64
    size_x: float64
    size_y: float64
    velocity_x: float64
    velocity_y: float64
    confidence: float32
    response: float32
    reacquired: bool
    age: uint32
    lost_for: uint32


@dataclass
class TrackArray(IdlStruct, typename="long_term_tracker::msg::dds_::TrackArray_"):
    header: Header
    algorithm: str
    tracks: sequence[Track]
    skipped: uint32
    processing_time: Duration


@dataclass
class Point2D(IdlStruct, typename="vision_msgs::msg::dds_::Point2D_"):
    x: float64
    y: float64


@dataclass
class Pose2D(IdlStruct, typename="vision_msgs::msg::dds_::Pose2D_"):
    position: Point2D
    theta: float64


@dataclass
class BoundingBox2D(IdlStruct, typename="vision_msgs::msg::dds_::BoundingBox2D_"):
    center: Pose2D
    size_x: float64
    size_y: float64


@dataclass
class ObjectHypothesis(IdlStruct, typename="vision_msgs::msg::dds_::ObjectHypothesis_"):
    class_id: str
    score: float64


@dataclass
class Point(IdlStruct, typename="geometry_msgs::msg::dds_::Point_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class Pose(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    position: Point
    orientation: Quaternion


@dataclass
class PoseWithCovariance(IdlStruct, typename="geometry_msgs::msg::dds_::PoseWithCovariance_"):
    pose: Pose
    covariance: array[float64, 36]


@dataclass
class ObjectHypothesisWithPose(IdlStruct, typename="vision_msgs::msg::dds_::ObjectHypothesisWithPose_"):
    hypothesis: ObjectHypothesis
    pose: PoseWithCovariance


@dataclass
class Detection2D(IdlStruct, typename="vision_msgs::msg::dds_::Detection2D_"):
    header: Header
    results: sequence[ObjectHypothesisWithPose]
    bbox: BoundingBox2D
    id: str


@dataclass
class Detection2DArray(IdlStruct, typename="vision_msgs::msg::dds_::Detection2DArray_"):
    header: Header
    detections: sequence[Detection2D]


def wait(condition, seconds):
    """Waits until the condition gives something, or for so long; gives what it gave."""
    end = time.monotonic() + seconds
    while not (result := condition()) and time.monotonic() < end:
        time.sleep(0.002)
    return result


def until(condition, what):
    """Waits until the condition gives something, and gives that."""
    result = wait(condition, DEADLINE)
    assert result, f"{what}: not within {DEADLINE} s"
    return result


class Peer:
    """A camera, a user and a listener."""

    def __init__(self):
        number = int(os.environ["ROS_DOMAIN_ID"])
        # Held for as long as the participant lives.
        self.domain = Domain(number, CONFIGURATION)
        participant = DomainParticipant(number)
        plain = Policy.DataRepresentation(use_cdrv0_representation=True)
        self.sensor = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(5), plain)
        self.reliable = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(100), plain)

        def topic(name, kind, qos):
            return Topic(participant, name, kind, qos=qos)

        self.images = DataWriter(participant, topic("rt/image", Image, self.sensor), qos=self.sensor)
        marks = topic("rt/tracker/init_roi", RegionOfInterest, self.reliable)
        self.marks = DataWriter(participant, marks, qos=self.reliable)
        tracks = topic("rt/tracker/tracks", TrackArray, self.reliable)
        self.tracks = DataReader(participant, tracks, qos=self.reliable)
        detections = topic("rt/tracker/detections", Detection2DArray, self.reliable)
        self.detections = DataReader(participant, detections, qos=self.reliable)
        self.scene = Scene()
        self.index = 0

    def connected(self):
        readers = self.images, self.marks
        writers = self.tracks, self.detections
        return all(w.get_matched_subscriptions() for w in readers) and all(r.get_matched_publications() for r in writers)

    def send(self):
        """Publishes the frame and waits for what is said of it. It is sent again where it was lost."""
        stamp = Time(1000 + self.index // 30, self.index % 30 * 33_333_333)
        pixels = self.scene.rgb(self.index).tobytes()
        image = Image(Header(stamp, "camera_optical"), HEIGHT, WIDTH, "rgb8", 0, WIDTH * 3, pixels)
        answer = lambda: next((t for t in self.tracks.take(100) if t.header.stamp == stamp), None)
        return until(lambda: self.images.write(image) or wait(answer, AGAIN), "tracks")

    def step(self):
        self.index += 1
        return self.send()

    def mark(self, x, y, width, height):
        self.marks.write(RegionOfInterest(x, y, height, width, False))


def main():
    peer = Peer()
    until(peer.connected, "the node's topics")
    assert peer.send().tracks == [], "nothing is followed before the mark"
    peer.mark(*peer.scene.box(peer.index))
    until(lambda: any(t.tracks for t in peer.tracks.take(100)), "the start")
    for age in range(1, 41):
        said = peer.step()
        overlap = iou(box_of(said.tracks[0]), peer.scene.box(peer.index))
        assert overlap > 0.5 and said.tracks[0].age == age, (overlap, said)
    assert (said.algorithm, said.header.frame_id, said.skipped) == ("lcmht", "camera_optical", 0), said
    seen = until(
        lambda: next((d for d in peer.detections.take(100) if d.header.stamp == said.header.stamp), None), "detections"
    )
    box = seen.detections[0].bbox
    assert (box.center.position.x, box.size_y) == (said.tracks[0].center_x, said.tracks[0].size_y), seen
    peer.mark(0, 0, 0, 0)
    until(lambda: not peer.step().tracks, "a mark of 0 x 0 stops")


if __name__ == "__main__":
    run(main)
