"""How the scripts here end: with a status, and without waiting for what a ROS library may still hold."""

import os
import sys
import traceback


def run(function, *arguments):
    """Runs the function and ends the process: with 0, or with 1 after the trace of what went wrong."""
    try:
        function(*arguments)
    except BaseException:
        traceback.print_exc()
        sys.stderr.flush()
        os._exit(1)
    os._exit(0)
