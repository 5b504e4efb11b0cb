"""What ROS's own tools and the example bring along: `tools.py FUNCTION ARGUMENTS...`."""

import importlib.util
import math
import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType

from script import run

REPOSITORY = Path(__file__).parents[2]
# Seconds until something that must happen has to have happened.
DEADLINE = 60.0


def launched(path):
    """The launch description of a file, with stand-ins for launch's classes that keep what they are given."""

    class Kept:
        def __init__(self, *arguments, **named):
            self.arguments, self.named = arguments, named

    modules = {
        "launch": ["LaunchDescription"],
        "launch.actions": ["DeclareLaunchArgument"],
        "launch.substitutions": ["LaunchConfiguration", "PathJoinSubstitution"],
        "launch_ros": [],
        "launch_ros.actions": ["Node"],
        "launch_ros.parameter_descriptions": ["ParameterFile", "ParameterValue"],
        "launch_ros.substitutions": ["FindPackageShare"],
    }
    for name, classes in modules.items():
        module = sys.modules[name] = ModuleType(name)
        for each in classes:
            setattr(module, each, type(each, (Kept,), {}))
    spec = importlib.util.spec_from_file_location("launch_file", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.generate_launch_description().arguments[0]


def launch():
    """Only presets that there are can be chosen, and the node itself is given the parameter file, before what wins."""
    *arguments, node = launched(REPOSITORY / "launch/tracker.launch.py")
    choices = {argument.arguments[0]: argument.named["choices"] for argument in arguments}
    presets = [path.stem for path in (REPOSITORY / "params").glob("*.yaml")]
    assert sorted(choices["preset"]) == sorted(presets), (choices, presets)
    assert choices["image_transport"] == ["raw", "compressed"] and choices["params_file"] is None, choices
    given = node.named["ros_arguments"]
    file = given[given.index("--params-file") + 1]
    assert file.arguments == ("params_file",), given
    assert all(isinstance(each, dict) for each in node.named["parameters"]), node.named["parameters"]


class Follower:
    """The example in a process of its own, and all that it talks to."""

    def __init__(self, **parameters):
        import rclpy
        from geometry_msgs.msg import TwistStamped
        from long_term_tracker.msg import TrackArray
        from sensor_msgs.msg import CameraInfo, RegionOfInterest

        rclpy.init(args=[])
        self.node = rclpy.create_node("camera")
        self.commands, self.marks, self.stamp = [], [], 0
        self.tracks = self.node.create_publisher(TrackArray, "tracker/tracks", 10)
        self.cameras = self.node.create_publisher(CameraInfo, "camera_info", 10)
        self.node.create_subscription(TwistStamped, "command", self.commands.append, 10)
        self.node.create_subscription(RegionOfInterest, "tracker/init_roi", self.marks.append, 10)
        given = [part for name, value in parameters.items() for part in ("-p", f"{name}:={value}")]
        script = REPOSITORY / "examples/follow.py"
        self.process = subprocess.Popen([sys.executable, script, "--ros-args", *given])
        self.until(
            lambda: self.tracks.get_subscription_count()
            and self.cameras.get_subscription_count()
            and self.node.count_publishers("/command"),
            "the follower",
        )

    def until(self, condition, what):
        """Waits for it."""
        import rclpy

        end = time.monotonic() + DEADLINE
        while not (result := condition()):
            assert time.monotonic() < end, f"no sign of {what}"
            assert self.process.poll() is None, "the follower ended"
            rclpy.spin_once(self.node, timeout_sec=0.05)
        return result

    def answer(self, *tracks):
        """The command for tracks of (x, y, state)."""
        from long_term_tracker.msg import Track, TrackArray

        self.stamp += 1
        message = TrackArray(tracks=[Track(id="1", center_x=x, center_y=y, state=state) for x, y, state in tracks])
        message.header.stamp.sec = self.stamp
        self.tracks.publish(message)
        mine = lambda: next((c for c in self.commands if c.header.stamp.sec == self.stamp), None)  # noqa: E731
        return self.until(mine, f"a command for {tracks}")


def rates(command):
    """How fast the camera pans and tilts."""
    angular, linear = command.twist.angular, command.twist.linear
    assert (angular.x, linear.x, linear.y, linear.z) == (0, 0, 0, 0), command
    return angular.z, angular.y


def follow():
    """The rates, their limit, the frame they are in, and when they are zero."""
    from sensor_msgs.msg import CameraInfo

    focal, x0, y0, gain, most, patience = 300.0, 160.0, 120.0, 2.0, 0.25, 1.5
    follower = Follower(gain=gain, max_rate=most, timeout=patience, frame_id="unit", mark="[10, 20, 30, 40]")
    tracking, uncertain, lost = 0, 1, 2
    try:
        # Nothing is followed: the mark is sent, and nothing turns.
        nothing = follower.answer()
        assert rates(nothing) == (0, 0) and nothing.header.frame_id == "unit", nothing
        mark = follower.until(lambda: follower.marks, "a mark")[0]
        assert (mark.x_offset, mark.y_offset, mark.width, mark.height) == (10, 20, 30, 40), mark
        # How far off the axis a pixel is nobody knows before the camera has said it.
        assert rates(follower.answer((300.0, 200.0, tracking))) == (0, 0)

        def seen():
            follower.cameras.publish(CameraInfo(k=[focal, 0.0, x0, 0.0, focal, y0, 0.0, 0.0, 1.0]))
            return rates(follower.answer((300.0, 200.0, tracking))) != (0, 0)

        follower.until(seen, "a turn")
        # Far to the right and below: to the right is negative, and both are at the limit.
        assert rates(follower.answer((310.0, 230.0, tracking))) == (-most, most)
        assert rates(follower.answer((10.0, 10.0, uncertain))) == (most, -most)
        command = follower.answer((x0 - 12, y0 + 6, tracking))
        assert command.header.frame_id == "unit"
        pan, tilt = rates(command)
        assert math.isclose(pan, gain * math.atan2(12, focal)) and math.isclose(tilt, gain * math.atan2(6, focal))

        assert rates(follower.answer((10.0, 10.0, lost))) == (0, 0), "it is lost"
        assert rates(follower.answer((310.0, 10.0, tracking))) == (-most, -most), "it is found again"
        assert rates(follower.answer()) == (0, 0), "there are no tracks in the message"

        # Silence: one command more, of its own time, after the timeout and not before.
        asked = time.monotonic()
        assert rates(follower.answer((310.0, 10.0, tracking))) != (0, 0)
        follower.commands.clear()
        stop = follower.until(lambda: follower.commands, "a stop")[0]
        assert time.monotonic() - asked >= patience, "it stopped too early"
        assert rates(stop) == (0, 0) and stop.header.frame_id == "unit" and stop.header.stamp.sec > follower.stamp
        assert rates(follower.answer((310.0, 10.0, tracking))) == (-most, -most), "tracks come again"
        follower.process.terminate()
        assert follower.process.wait(DEADLINE) == 0
    finally:
        follower.process.kill()
        follower.process.wait()


if __name__ == "__main__":
    run({"launch": launch, "follow": follow}[sys.argv[1]], *sys.argv[2:])
