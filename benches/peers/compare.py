#!/usr/bin/env python3
"""Runs OpenCV's trackers and this one over the same sequences, one thread each, and compares accuracy and speed.

    pip install -r benches/peers/requirements.txt
    python3 benches/peers/compare.py DATASET [--output target/peers] [--trackers CSRT,KCF] [--sequences A,B]
        [--limit FRAMES] [--again] [--peer NAME=DIR]... [--evaluate PROGRAM] [-- ARGUMENTS OF evaluate]

Boxes and times go to OUTPUT/TRACKER (see opencv.py; existing results are kept, unless --again is given), the page and
its figures to OUTPUT/report. --peer adds boxes of other trackers. This tracker is run with params/default.yaml and
params/fast.yaml, by cargo unless --evaluate names a program.
"""

import argparse
import pathlib
import subprocess
import sys

import opencv

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
PRESETS = ["default", "fast"]


def evaluate(options):
    """The command that scores everything."""
    cargo = ["cargo", "run", "--release", "--quiet", "--manifest-path", REPOSITORY / "Cargo.toml"]
    command = [options.evaluate] if options.evaluate else [*cargo, "--bin", "evaluate", "--"]
    command += [options.dataset, "--threads", "1", "--report", options.output / "report"]
    for preset in PRESETS:
        command += ["--params", REPOSITORY / "params" / f"{preset}.yaml"]
    for tracker in options.trackers:
        command += ["--peer", f"{tracker}={options.output / tracker}"]
    for peer in options.peer:
        command += ["--peer", peer]
    if options.sequences:
        command += ["--sequences", ",".join(options.sequences)]
    if options.limit < sys.maxsize:
        command += ["--frames", str(options.limit)]
    return command


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=pathlib.Path, help="the folder of sequences")
    parser.add_argument("--output", type=pathlib.Path, default=REPOSITORY / "target" / "peers", help="folder for all results")
    parser.add_argument("--peer", action="append", default=[], metavar="NAME=DIR", help="boxes of another tracker")
    parser.add_argument("--evaluate", metavar="PROGRAM", help="a program that is already built")
    opencv.arguments(parser)
    at = sys.argv.index("--") if "--" in sys.argv else len(sys.argv)
    options = parser.parse_args(sys.argv[1:at])
    opencv.run_all(options)
    sys.exit(subprocess.run(evaluate(options) + sys.argv[at + 1 :], check=False).returncode)


if __name__ == "__main__":
    main()
