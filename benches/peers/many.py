#!/usr/bin/env python3
"""Runs MAPTrack, and SORT on the very blobs that MAPTrack sees, over sequences with many targets, and scores both.

    pip install -r benches/peers/requirements-many.txt
    python3 benches/peers/many.py SEQUENCES/mot [--output target/many] [--sequences A,B] [--rows NAME=DIR]...
        [--track PROGRAM] [--blobs PROGRAM] [-- ARGUMENTS OF track]

A sequence is a folder with gt.txt in MOTChallenge format and images, in img/ or, if img is a file, in the folder that it
names. No target is marked. Rows go to OUTPUT/TRACKER/SEQUENCE.txt, all scores to OUTPUT/results.json, a table to standard
output. --rows adds another tracker's rows. The programs are run by cargo unless they are named; arguments of track (-p,
--params) go to both.

SORT (Bewley et al. 2016) is from PyPI's `trackers`: with its own settings, and as published, which drops a track after one
frame without a detection. Scores are from TrackEval. The paper's table 2 adds correct, the true boxes that are covered,
and false, the tracks that never cover a person; see mot.py.
"""

import argparse
import json
import pathlib
import subprocess
import sys

import numpy as np
import supervision
from trackers import SORTTracker

import mot

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
TRUTH = "gt.txt"
IMAGES = {".jpg", ".jpeg", ".png"}
OURS = "maptrack"
BLOBS = "blobs"
SORTS = {"SORT": {}, "SORT-published": {"lost_track_buffer": 1}}
COLUMNS = ["HOTA", "MOTA", "IDF1", "switches", "missed", "false", "tracks"]


def images(sequence):
    """The folder of a sequence's images."""
    folder = sequence / "img"
    return folder if folder.is_dir() else (sequence / folder.read_text().strip()).resolve()


def frames(sequence):
    """How many there are."""
    return sum(path.suffix.lower() in IMAGES for path in images(sequence).iterdir())


def command(program, kind, name):
    """How to run one of the programs."""
    cargo = ["cargo", "run", "--release", "--quiet", "--manifest-path", REPOSITORY / "Cargo.toml"]
    return [program] if program else [*cargo, kind, name, "--"]


def run(arguments, path):
    """Runs a program and keeps what it prints."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w") as out:
        if subprocess.run(arguments, stdout=out, check=False).returncode:
            sys.exit(f"{' '.join(map(str, arguments))}: failed")


def sort(blobs, count, settings):
    """The rows of SORT on detections."""
    tracker = SORTTracker(**settings)
    rows = []
    for frame in range(1, count + 1):
        here = blobs[blobs[:, mot.FRAME] == frame]
        corners = np.hstack([here[:, 2:4], here[:, 2:4] + here[:, 4:6]])
        found = tracker.update(supervision.Detections(xyxy=corners, confidence=np.ones(len(here))))
        for (left, top, right, bottom), identity in zip(found.xyxy, found.tracker_id, strict=True):
            # Tracks that are not believed yet have -1.
            if identity >= 0:
                rows.append([frame, identity, left, top, right - left, bottom - top, 1])
    return rows


def track(sequence, options):
    """Makes the rows of all trackers; gives their paths."""
    rows = {name: options.output / name / f"{sequence.name}.txt" for name in [OURS, BLOBS, *SORTS]}
    source = [images(sequence), *options.arguments]
    run([*command(options.track, "--bin", "track"), *source, "--algorithm", OURS], rows[OURS])
    run([*command(options.blobs, "--example", "blobs"), *source], rows[BLOBS])
    blobs = mot.read(rows.pop(BLOBS))
    for name, settings in SORTS.items():
        mot.write(rows[name], sort(blobs, frames(sequence), settings))
    others = dict(option.split("=", 1) for option in options.rows)
    return rows | {name: pathlib.Path(folder) / f"{sequence.name}.txt" for name, folder in others.items()}


def row(sequence, tracker, scores):
    """A line of the table."""
    numbers = [f"{scores[c]:.1f}" if isinstance(scores[c], float) else str(scores[c]) for c in COLUMNS]
    counts = scores["table2"]
    correct = f"{counts['correct']}/{counts['boxes']} ({counts['false_tracks']})"
    return f"{sequence:14} {tracker:14} " + " ".join(f"{n:>8}" for n in numbers) + f" {correct:>16}"


def listed(text):
    return [name for name in text.split(",") if name]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=pathlib.Path, help="the folder of sequences")
    parser.add_argument("--output", type=pathlib.Path, default=REPOSITORY / "target" / "many", help="folder for all results")
    parser.add_argument("--sequences", type=listed, default=[], help="only these sequences")
    parser.add_argument("--rows", action="append", default=[], metavar="NAME=DIR", help="rows of another tracker")
    parser.add_argument("--track", metavar="PROGRAM", help="a program that is already built")
    parser.add_argument("--blobs", metavar="PROGRAM", help="an example that is already built")
    at = sys.argv.index("--") if "--" in sys.argv else len(sys.argv)
    options = parser.parse_args(sys.argv[1:at])
    options.arguments = sys.argv[at + 1 :]
    names = options.sequences or sorted(path.parent.name for path in options.dataset.glob(f"*/{TRUTH}"))
    if not names:
        sys.exit(f"{options.dataset}: no sequences (folders with a {TRUTH}) in the folder")
    print(f"{'':29} " + " ".join(f"{c:>8}" for c in COLUMNS) + f" {'correct (false)':>16}")
    results = {}
    for name in names:
        sequence = options.dataset / name
        truth = mot.read(sequence / TRUTH)
        for tracker, path in track(sequence, options).items():
            scores = mot.score(truth, mot.read(path), frames(sequence))
            results.setdefault(name, {})[tracker] = scores
            print(row(name, tracker, scores), flush=True)
    (options.output / "results.json").write_text(json.dumps(results, indent=1) + "\n")


if __name__ == "__main__":
    main()
