"""A user of the installed package: `installed.py`, in a shell that has sourced the install folder and nothing else of
this package.

Starts the node and the follower from where `ros2 run` would take them, plays the camera and checks what comes out.
"""

from pathlib import Path

from ament_index_python.packages import get_package_prefix, get_package_share_directory
from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import CameraInfo

from peer import *  # noqa: F403
from script import child, run

# Of the camera, in pixels.
FOCAL = 300.0
# Frames within which the target is followed again after it has come back.
FOUND = 120


def program(*arguments):
    """A program of the package."""
    path = Path(get_package_prefix("long_term_tracker"), "lib/long_term_tracker", arguments[0])
    return child([path, *arguments[1:]])


def as_launched(parameters):
    """What launch gives a node that has a namespace, a name, a parameter file and renamed topics."""
    launched = ["-r", "__node:=eye", "-r", "__ns:=/robot", "--params-file", parameters]
    renamed = ["-r", "image:=/camera/image_raw", "-r", "~/tracks:=~/tracks"]
    return ["--ros-args", "--log-level", "info", "--ros-args", *launched, *renamed]


def check_pointing(command, peer):
    """The command turns the camera to the side on which the target is."""
    x, y, w, h = peer.scene.box(peer.index)
    right, down = x + w / 2 - WIDTH / 2, y + h / 2 - HEIGHT / 2
    # Within a few pixels of the axis the estimate decides the sign.
    if abs(right) > 5:
        assert command.angular.z * right < 0, (peer.index, right, command.angular)
    if abs(down) > 5:
        assert command.angular.y * down > 0, (peer.index, down, command.angular)
    assert abs(command.angular.z + np.arctan2(right, FOCAL)) < 0.05, (peer.index, right, command.angular)


def follow(peer):
    """Every image is answered by a turn to the target, none while it is lost."""
    commands = peer.listen(TwistStamped, "/robot/command", 10)

    def turn():
        """The command for the next image, and what was said of it."""
        said = peer.step()
        stamp = stamp_of(said)
        answer = peer.spin_until(lambda: next((c for c in commands if stamp_of(c) == stamp), None), "a command")
        return said, answer.twist

    cameras = peer.node.create_publisher(CameraInfo, "/camera/camera_info", 10)
    peer.spin_until(cameras.get_subscription_count, "the follower")
    k = [FOCAL, 0.0, WIDTH / 2, 0.0, FOCAL, HEIGHT / 2, 0.0, 0.0, 1.0]

    def marked():
        """The target stands still until all have found each other, for what is sent before may be lost."""
        return peer.send(peer.message(0)).tracks and commands

    peer.spin_until(marked, "the follower's mark")

    def moves():
        cameras.publish(CameraInfo(width=WIDTH, height=HEIGHT, k=k))
        return turn()[1].angular.z != 0

    peer.spin_until(moves, "the first turn")
    hidden = peer.scene.hidden = range(peer.index + 30, peer.index + 60)
    states = []
    while peer.index < hidden.stop + FOUND and states[-10:] != [0] * 10 or peer.index < hidden.stop:
        said, command = turn()
        states.append(said.tracks[0].state)
        if states[-1] == 2:
            assert (command.angular.y, command.angular.z) == (0, 0), command
        elif states[-1] == 0 and peer.index not in hidden:
            check_pointing(command, peer)
    assert states[:20] == [0] * 20 and 2 in states[20:] and states[-10:] == [0] * 10, states

    # Without images there are no tracks.
    commands.clear()
    stopped = peer.spin_until(lambda: commands, "a stop when no tracks come")[0]
    assert (stopped.twist.angular.y, stopped.twist.angular.z) == (0, 0)


def main():
    share = Path(get_package_share_directory("long_term_tracker"))
    compile((share / "launch/tracker.launch.py").read_text(), "tracker.launch.py", "exec")
    assert (share / "msg/Track.msg").is_file()
    parameters = share / "params/default.yaml"
    for offline in ["track", "evaluate"]:
        assert program(offline, "--version").wait(DEADLINE) == 0
    box = "[{}, {}, {}, {}]".format(*Scene().box(0))
    started = [program("tracker_node", *as_launched(parameters))]
    arguments = ["-p", "tracker:=eye", "-p", f"mark:={box}", "-r", "camera_info:=/camera/camera_info"]
    started.append(program("follow.py", "--ros-args", "-r", "__ns:=/robot", *arguments))
    try:
        peer = Peer(tracker="/robot/eye", image="/camera/image_raw")
        peer.spin_until(lambda: {"/robot/eye", "/robot/follow"} <= set(peer.listed()), "both nodes")
        peer.spin_until(lambda: peer.images.get_subscription_count(), "the camera's subscriber")

        def answered():
            peer.images.publish(peer.message(0))
            return peer.tracks

        peer.spin_until(answered, "tracks")
        follow(peer)
        seen = peer.detections[-1]
        assert seen.detections[0].results[0].hypothesis.class_id and seen.header.frame_id == "camera_optical"
        for process in started[::-1]:
            process.terminate()
            assert process.wait(DEADLINE) == 0, process.args
    finally:
        for process in started:
            process.kill()


if __name__ == "__main__":
    run(main)
