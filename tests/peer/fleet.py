"""A fleet on two Ray nodes of which one is killed while it tracks; see tests/fleet.rs.

    fleet.py TRACK OUT SCRATCH RECORDING... -- OPTIONS

Runs in a network and process name space of its own: nothing but loopback is there, and every process ends with it.
"""

import fcntl
import os
import pathlib
import signal
import socket
import struct
import subprocess
import sys
import time

SIOCSIFFLAGS, IFF_UP = 0x8914, 1
# Only ends what hangs.
DEADLINE = 300
STORE = 80_000_000


def loopback_up():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        fcntl.ioctl(any_socket, SIOCSIFFLAGS, struct.pack("16sH22x", b"lo", IFF_UP))
    names = [name for _, name in socket.if_nameindex()]
    assert names == ["lo"], names


def children(pid):
    """The processes below one, with their arguments."""
    parents = {}
    for entry in pathlib.Path("/proc").iterdir():
        try:
            if entry.name.isdigit():
                # The name, in brackets, may hold blanks.
                parents[int(entry.name)] = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
        except OSError:
            pass
    found, new = set(), {pid}
    while new:
        found |= new
        new = {child for child, parent in parents.items() if parent in new} - found
    return found - {pid}


def arguments(pid):
    try:
        return pathlib.Path(f"/proc/{pid}/cmdline").read_text().split("\0")
    except OSError:
        return []


def tracking(raylet, track):
    """The processes of a node that track a recording, with its name."""
    commands = {pid: arguments(pid) for pid in children(raylet)}
    return {pid: words[1] for pid, words in commands.items() if words[:1] == [track] and "--out" in words}


def main():
    own, options = sys.argv[1:], []
    own, options = own[: own.index("--")], own[own.index("--") + 1 :]
    track, out, scratch, *recordings = own
    loopback_up()
    os.environ.update(RAY_USAGE_STATS_ENABLED="0", RAY_TMPDIR=scratch, RAY_raylet_start_wait_time_s=str(DEADLINE))
    from ray.cluster_utils import Cluster

    node = {"num_cpus": 1, "object_store_memory": STORE}
    cluster = Cluster(initialize_head=True, head_node_args={**node, "include_dashboard": False})
    lost = cluster.add_node(**node)
    cluster.wait_for_nodes()
    [raylet] = [process.process.pid for process in lost.all_processes["raylet"]]

    script = pathlib.Path(__file__).parents[2] / "examples/fleet.py"
    command = [sys.executable, str(script), *recordings, "--out", out, "--track", track, "--address", cluster.address]
    fleet = subprocess.Popen([*command, "--", *options])
    end = time.monotonic() + DEADLINE
    # The second recording of the node, so that it has given rows as well.
    first, second = None, None
    while second is None:
        assert time.monotonic() < end and fleet.poll() is None, "the node tracked no second recording"
        for pid, name in tracking(raylet, track).items():
            first = first or name
            if name != first:
                # So that it is in the middle of it when it ends.
                os.kill(pid, signal.SIGSTOP)
                second = name
        time.sleep(0.005)
    doomed = children(raylet)
    cluster.remove_node(lost, allow_graceful=False)
    for pid in doomed:
        try:
            os.kill(pid, signal.SIGKILL)
        except ProcessLookupError:
            pass
    name = pathlib.Path(second).name
    assert not (pathlib.Path(out) / f"{name}.csv").exists(), f"{name} was done before its node was killed"
    print(f"killed the node that had tracked {pathlib.Path(first).name} while it tracked {name}", flush=True)
    code = fleet.wait(DEADLINE)
    cluster.shutdown()
    return code


if __name__ == "__main__":
    sys.exit(main())
