"""How the scripts here begin others and end: with a status, and without waiting for what a ROS library may still hold."""

import ctypes
import os
import signal
import subprocess
import sys
import traceback

# Of prctl(2): the signal that a process gets when its parent dies.
PR_SET_PDEATHSIG = 1


def child(arguments, **options):
    """A process that does not outlive this one, however this one ends."""
    die_with_parent = lambda: ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    return subprocess.Popen(arguments, preexec_fn=die_with_parent, **options)


def run(function, *arguments):
    """Runs the function and ends the process: with 0, or with 1 after the trace of what went wrong."""
    try:
        function(*arguments)
    except BaseException:
        traceback.print_exc()
        sys.stderr.flush()
        os._exit(1)
    os._exit(0)
