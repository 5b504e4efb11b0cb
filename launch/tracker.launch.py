"""Starts the tracker.

    ros2 launch long_term_tracker tracker.launch.py image:=/camera/image_raw viewer:=8080
    ros2 launch long_term_tracker tracker.launch.py namespace:=robot name:=eye preset:=paper log_level:=debug
    ros2 launch long_term_tracker tracker.launch.py --show-args

From another launch file, include it with `IncludeLaunchDescription` and give what differs in `launch_arguments`.
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
    ("name", "tracker", "Name of the node; its topics and services lie below it."),
    ("image", "image", "Topic of the raw images; with another image_transport, what that appends to it is listened to."),
    ("image_transport", "raw", "How images come: raw or compressed; wins over the parameter file."),
    ("preset", "default", "Which of the package's parameter files."),
    (
        "params_file",
        [PathJoinSubstitution([FindPackageShare(PACKAGE), "params", LaunchConfiguration("preset")]), ".yaml"],
        "Parameter file in place of a preset's.",
    ),
    ("tracks", "~/tracks", "Topic of the tracks."),
    ("detections", "~/detections", "Topic of the detections for tools that speak vision_msgs."),
    ("init_roi", "~/init_roi", "Topic on which targets are marked."),
    ("viewer", "0", "Port of the live page for a browser, on this machine; 0 serves none; wins over the parameter file."),
    ("use_sim_time", "false", "Accepted as by every node; the tracker takes its time from the images."),
    ("log_level", "info", "debug, info, warn, error or fatal."),
]
# What an argument may be, where that is a choice.
CHOICES = {"preset": PRESETS, "image_transport": ["raw", "compressed"]}
# Topics that have an argument of their own.
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
        # These come after the file and win over it.
        parameters=[
            {
                "image_transport": ParameterValue(LaunchConfiguration("image_transport"), value_type=str),
                "viewer.port": ParameterValue(LaunchConfiguration("viewer"), value_type=int),
                "use_sim_time": ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool),
            },
        ],
        remappings=[(topic, LaunchConfiguration(argument)) for topic, argument in REMAPPED.items()],
        # Handed to the node as it is: what is no file ends the node, where launch would pass it over.
        ros_arguments=[
            "--log-level",
            LaunchConfiguration("log_level"),
            "--params-file",
            LaunchConfiguration("params_file"),
        ],
    )
    return LaunchDescription([*arguments, node])
