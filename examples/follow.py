#!/usr/bin/env python3
"""Keeps a marked target in the middle of the image by turning a pan-tilt unit.

    ros2 run long_term_tracker follow.py --ros-args -p mark:="[528, 182, 31, 101]" \\
        -r camera_info:=/camera/camera_info -r command:=/pan_tilt/cmd_vel

Subscribes to the tracks and to the camera's intrinsics, and publishes a turning rate for every image
(geometry_msgs/TwistStamped, rad/s, axes of REP 103: positive angular.z pans left, positive angular.y tilts down). The
rate is proportional to the angle between the target and the optical axis. It is zero while the target is lost or no
tracks arrive.
"""

import math

import rclpy
from geometry_msgs.msg import TwistStamped
from long_term_tracker.msg import Track, TrackArray
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, RegionOfInterest

# Seconds between checks that tracks still arrive, and between marks until a target is followed.
WATCH, AGAIN = 0.1, 1.0


class Follow(Node):
    """From tracks to turning rates."""

    def __init__(self):
        super().__init__("follow")
        tracker = self.declare_parameter("tracker", "tracker").value
        # x, y, width and height of a target to mark at the start, in pixels; zeros: follow what others mark.
        self.box = list(self.declare_parameter("mark", [0, 0, 0, 0]).value)
        if len(self.box) != 4:
            raise ValueError(f"mark has the four numbers x, y, width, height, got {self.box}")
        self.frame = self.declare_parameter("frame_id", "camera_link").value
        # Rate per radian off the axis, in 1/s, and the maximum rate, in rad/s.
        self.gain = self.declare_parameter("gain", 1.0).value
        self.most = self.declare_parameter("max_rate", 1.0).value
        # Seconds without tracks after which it stops.
        self.patience = self.declare_parameter("timeout", 0.5).value
        self.camera = None
        self.heard = None
        self.marked = None
        self.state = None

        self.marks = self.create_publisher(RegionOfInterest, f"{tracker}/init_roi", 10)
        self.commands = self.create_publisher(TwistStamped, "command", 10)
        self.create_subscription(CameraInfo, "camera_info", self.on_camera_info, qos_profile_sensor_data)
        self.create_subscription(TrackArray, f"{tracker}/tracks", self.on_tracks, 10)
        self.create_timer(WATCH, self.watch)

    def on_camera_info(self, info):
        if info.k[0] > 0 and info.k[4] > 0:
            self.camera = info

    def on_tracks(self, message):
        self.heard = self.get_clock().now()
        if not message.tracks:
            self.mark()
            self.command(message.header.stamp)
            return
        self.box = [0, 0, 0, 0]
        track = message.tracks[0]
        if track.state != self.state:
            self.state = track.state
            name = {Track.TRACKING: "followed", Track.UNCERTAIN: "hard to see", Track.LOST: "lost"}[track.state]
            self.get_logger().info(f"target {track.id} is {name}")
        if track.state == Track.LOST or self.camera is None:
            self.command(message.header.stamp)
            return
        right, down = self.angles(track.center_x, track.center_y)
        self.command(message.header.stamp, pan=-self.gain * right, tilt=self.gain * down)

    def mark(self):
        """Marks the target in the newest image, again and again until it is followed."""
        x, y, width, height = self.box
        if width <= 0 or height <= 0:
            return
        if self.marked is None or (self.heard - self.marked).nanoseconds > AGAIN * 1e9:
            self.marked = self.heard
            self.marks.publish(RegionOfInterest(x_offset=x, y_offset=y, width=width, height=height))

    def angles(self, x, y):
        """Angles of a pixel to the right of and below the optical axis, in radians."""
        k = self.camera.k
        return math.atan2(x - k[2], k[0]), math.atan2(y - k[5], k[4])

    def command(self, stamp, pan=0.0, tilt=0.0):
        message = TwistStamped()
        message.header.stamp = stamp
        message.header.frame_id = self.frame
        message.twist.angular.z = min(max(pan, -self.most), self.most)
        message.twist.angular.y = min(max(tilt, -self.most), self.most)
        self.commands.publish(message)

    def watch(self):
        """Stops when no more tracks arrive."""
        now = self.get_clock().now()
        if self.heard and (now - self.heard).nanoseconds > self.patience * 1e9:
            self.heard = None
            self.get_logger().warning(f"no tracks for {self.patience} s")
            self.command(now.to_msg())


def main():
    rclpy.init()
    node = Follow()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except RuntimeError:
        # A signal that comes while rclpy is not waiting makes its next call fail with this.
        if rclpy.ok():
            raise
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
