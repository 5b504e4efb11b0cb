"""What rclpy makes of parameter files and arguments: `parameter_files.py CASES ANSWERS`.

CASES holds a list of cases as JSON: a namespace and what would follow `--ros-args`. For each, ANSWERS gets why a node of
the name `tracker` is refused, as text, or its parameters: for each name null, or a type and a value. Floats are told by
their bits, so that nothing is lost.
"""

import json
import math
import struct
import sys

import rclpy
from rclpy.node import Node

from script import run


def bits(number):
    return "nan" if math.isnan(number) else struct.pack(">d", number).hex()


def told(parameter):
    kind, value = parameter.type_.name, parameter.value
    if kind == "NOT_SET":
        return None
    if kind == "DOUBLE":
        value = bits(value)
    elif kind == "DOUBLE_ARRAY":
        value = [bits(number) for number in value]
    elif kind.endswith("ARRAY"):
        value = list(value)
    return [kind, value]


def answer(namespace, *arguments):
    try:
        node = Node(
            "tracker",
            namespace=namespace,
            cli_args=["--ros-args", *arguments],
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
        )
    except Exception as why:
        return f"{type(why).__name__}: {why}"
    overrides = {name: told(parameter) for name, parameter in node._parameter_overrides.items()}
    node.destroy_node()
    return overrides


def main(cases, answers):
    with open(cases) as file:
        cases = json.load(file)
    rclpy.init(args=[])
    with open(answers, "w") as file:
        json.dump([answer(*case) for case in cases], file)


if __name__ == "__main__":
    run(main, *sys.argv[1:])
