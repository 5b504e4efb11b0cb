"""Starts the tracker.

    ros2 launch long_term_tracker tracker.launch.py image:=/camera/image_raw viewer:=8080
    ros2 launch long_term_tracker tracker.launch.py namespace:=robot name:=eye preset:=paper log_level:=debug
    ros2 launch long_term_tracker tracker.launch.py --show-args

To use it in another launch file, include it with `IncludeLaunchDescription` and set `launch_arguments`.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

PACKAGE = "long_term_tracker"

# The files in params/, without .yaml.
PRESETS = ["default", "fast", "matching", "paper", "etepf", "maptrack", "maptrack_near"]
# Name, default and description.
ARGUMENTS = [
    ("namespace", "", "Namespace of the node and of its topics."),
    ("name", "tracker", "Name of the node; its topics and services are below it."),
    ("image", "image", "Image topic. With image_transport:=compressed, /compressed is appended to it."),
    ("image_transport", "raw", "How images arrive: raw or compressed. Overrides the parameter file."),
    ("preset", "default", "One of the package's parameter files."),
    (
        "params_file",
        [PathJoinSubstitution([FindPackageShare(PACKAGE), "params", LaunchConfiguration("preset")]), ".yaml"],
        "Your own parameter file, instead of a preset.",
    ),
    ("tracks", "~/tracks", "Topic of the tracks."),
    ("detections", "~/detections", "Topic of the detections (vision_msgs)."),
    ("init_roi", "~/init_roi", "Topic for marks."),
    ("viewer", "0", "Port of the live page, on this machine. 0 switches it off. Overrides the parameter file."),
    ("use_sim_time", "false", "Accepted, as by every node; the tracker uses the images' stamps."),
    ("log_level", "info", "debug, info, warn, error or fatal."),
]
# Allowed values, where there is a choice.
CHOICES = {"preset": PRESETS, "image_transport": ["raw", "compressed"]}
# Topics with an argument of their own.
REMAPPED = {"image": "image", "~/tracks": "tracks", "~/detections": "detections", "~/init_roi": "init_roi"}


def generate_launch_description():
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=description, choices=CHOICES.get(name))
        for name, default, description in ARGUMENTS
    ]
    node = Node(
        package=PACKAGE,
        executable="tracker_node",
        namespace=LaunchConfiguration("namespace"),
        name=LaunchConfiguration("name"),
        output="screen",
        emulate_tty=True,
        # These come after the file and override it.
        parameters=[
            {
                "image_transport": ParameterValue(LaunchConfiguration("image_transport"), value_type=str),
                "viewer.port": ParameterValue(LaunchConfiguration("viewer"), value_type=int),
                "use_sim_time": ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool),
            },
        ],
        remappings=[(topic, LaunchConfiguration(argument)) for topic, argument in REMAPPED.items()],
        # Passed on unchanged: the node exits if the file does not exist, where launch would ignore it.
        ros_arguments=[
            "--log-level",
            LaunchConfiguration("log_level"),
            "--params-file",
            LaunchConfiguration("params_file"),
        ],
    )
    return LaunchDescription([*arguments, node])
