#!/usr/bin/env python3
"""Tracks many recordings on many machines: `track --out`, spread by Ray (pip install ray).

    ray start --head --include-dashboard=false --disable-usage-stats    # on this machine
    ray start --address=THIS_MACHINE:6379 --disable-usage-stats         # on each of the others
    python3 examples/fleet.py recordings/* --out results -- --params fast.yaml --marks marks.csv

Recordings, and files that options name, must have the same paths on every machine; `track` must be installed there. The
rows come back to the folder here. Recordings with rows are skipped, so a run that was ended goes on when it is started
again. Ray gives the recordings of a machine that is lost to the others.
"""

import argparse
import os
import pathlib
import subprocess
import sys
import tempfile

import ray

# How often a recording is given to another machine when the one that tracks it is lost.
RETRIES = 5


@ray.remote(num_cpus=1, max_retries=RETRIES)
def tracked(track, recording, options, folder):
    """The rows of a recording by the name of their file, and what `track` said. No rows if it failed."""
    with tempfile.TemporaryDirectory() as out:
        command = [track, recording, "--out", out, *options]
        done = subprocess.run(command, cwd=folder, stderr=subprocess.PIPE, text=True, check=False)
        return {file.name: file.read_bytes() for file in pathlib.Path(out).glob("*.csv")}, done.stderr


def keep(path, data):
    """Writes a file that is there whole or not at all."""
    partial = path.with_name(f".partial-{os.getpid()}")
    with open(partial, "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    partial.replace(path)


def arguments():
    own, options = sys.argv[1:], []
    if "--" in own:
        at = own.index("--")
        own, options = own[:at], own[at + 1 :]
    parser = argparse.ArgumentParser(description="Track many recordings on many machines.")
    parser.usage = "%(prog)s RECORDING... --out DIR [--track PROGRAM] [--address ADDRESS] [-- OPTIONS OF TRACK]"
    parser.add_argument("recordings", nargs="+", metavar="RECORDING", help="a folder of images or a bag")
    parser.add_argument("--out", required=True, metavar="DIR", help="the folder for rows and summary, on this machine")
    parser.add_argument("--track", default="track", metavar="PROGRAM", help="the program on each machine")
    parser.add_argument("--address", default="auto", help="the Ray cluster; default: the one of this machine")
    return parser.parse_args(own), options


def main():
    args, options = arguments()
    command = [args.track, *args.recordings, "--out", args.out, *options]
    # Refuses arguments that cannot be used before anything is spread.
    listed = subprocess.run([*command, "--pending"], stdout=subprocess.PIPE, text=True, check=False)
    if listed.returncode:
        return listed.returncode
    pending = listed.stdout.splitlines()
    if pending:
        ray.init(address=args.address, log_to_driver=False)
        waiting = {tracked.remote(args.track, name, options, os.getcwd()): name for name in pending}
        while waiting:
            [done], _ = ray.wait(list(waiting), num_returns=1)
            recording = waiting.pop(done)
            try:
                files, said = ray.get(done)
            except ray.exceptions.RayError as error:
                files, said = {}, f"{error}\n"
            for name, data in files.items():
                keep(pathlib.Path(args.out) / name, data)
            if not files:
                print(f"{recording}, on a machine of the cluster: {said}", end="", file=sys.stderr)
        ray.shutdown()
    # Tries once more, here, what no machine could do; and writes the summary.
    return subprocess.run(command, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
