#!/usr/bin/env python3
"""Runs OpenCV's trackers with their default settings and writes what `evaluate --peer NAME=DIR` reads.

    pip install -r benches/peers/requirements.txt
    python3 benches/peers/opencv.py DATASET OUTPUT [--trackers CSRT,KCF] [--sequences A,B] [--limit FRAMES] [--again]

DATASET holds one folder per sequence: img/ and groundtruth_rect.txt (x,y,w,h per row, NaN = not in view). For each
tracker this writes OUTPUT/TRACKER/SEQUENCE.txt, x,y,w,h per row, the first from the ground truth, NaN where the tracker
reports the target lost; and OUTPUT/TRACKER/times.csv: sequence, frames, seconds of processor time without reading and
decoding, as in `evaluate`. One thread is used. Existing results are kept, unless --again is given.
"""

import argparse
import csv
import math
import pathlib
import sys
import time

import cv2
import numpy as np

import sequences

# Trackers that were superseded have moved to cv2.legacy.
CREATE = {
    "CSRT": lambda: cv2.TrackerCSRT_create(),
    "KCF": lambda: cv2.TrackerKCF_create(),
    "MIL": lambda: cv2.TrackerMIL_create(),
    "MOSSE": lambda: cv2.legacy.TrackerMOSSE_create(),
    "MedianFlow": lambda: cv2.legacy.TrackerMedianFlow_create(),
    "TLD": lambda: cv2.legacy.TrackerTLD_create(),
}
LOST = (math.nan,) * 4
# Some of the trackers draw random numbers.
SEED = 1
TIMES = "times.csv"
HEADER = ["sequence", "frames", "seconds"]


def track(create, paths, first):
    """Boxes of all images, the first included, and the seconds of processor time that the tracker took."""
    cv2.setRNGSeed(SEED)
    tracker = create()
    boxes, seconds = [], 0.0
    for path in paths:
        image = sequences.read_image(path)
        begin = time.process_time()
        if not boxes:
            tracker.init(image, tuple(round(v) for v in first))
            box = first
        else:
            box = update(tracker, image)
        seconds += time.process_time() - begin
        boxes.append(box)
    return np.array(boxes, float), seconds


def update(tracker, image):
    """The tracker's box, NaN where it has none. A fault inside it is no box either."""
    try:
        found, box = tracker.update(image)
    except cv2.error:
        return LOST
    return box if found else LOST


def read_times(path):
    """Frames and seconds by sequence, as they were written."""
    if not path.exists():
        return {}
    with path.open(newline="") as file:
        return {row["sequence"]: (int(row["frames"]), float(row["seconds"])) for row in csv.DictReader(file)}


def write_times(path, times):
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(HEADER)
        rows.writerows([name, frames, f"{seconds:.3f}"] for name, (frames, seconds) in times.items())


def write_boxes(path, boxes):
    np.savetxt(path, boxes, fmt="%.3f", delimiter=",")


def run(tracker, dataset, output, names, limit, again):
    """Runs one tracker over the sequences, and says how fast it was on each."""
    folder = output / tracker
    folder.mkdir(parents=True, exist_ok=True)
    times = read_times(folder / TIMES)
    for name in names:
        truth = sequences.read_truth(dataset / name)
        paths = sequences.images(dataset / name)
        count = min(len(paths), len(truth), limit)
        boxes_path = folder / f"{name}.txt"
        if not again and boxes_path.exists() and times.get(name, (0,))[0] >= count:
            continue
        boxes, seconds = track(CREATE[tracker], paths[:count], truth[0])
        write_boxes(boxes_path, boxes)
        times[name] = (count, seconds)
        write_times(folder / TIMES, times)
        lost = int(np.isnan(boxes[:, 0]).sum())
        print(f"{tracker:10} {name:20} {count:6} frames {lost:6} lost {count / seconds:8.1f} fps", flush=True)


def listed(text):
    return [name for name in text.split(",") if name]


def arguments(parser):
    """What compare.py takes as well."""
    parser.add_argument("--trackers", type=listed, default=list(CREATE), help=f"some of {','.join(CREATE)}")
    parser.add_argument("--sequences", type=listed, default=[], help="only these sequences")
    parser.add_argument("--limit", type=int, default=sys.maxsize, help="maximum number of frames per sequence")
    parser.add_argument("--again", action="store_true", help="also run what already has results")


def run_all(options):
    unknown = [name for name in options.trackers if name not in CREATE]
    if unknown:
        sys.exit(f"no tracker '{unknown[0]}'; there are {', '.join(CREATE)}")
    cv2.setNumThreads(1)
    cv2.ocl.setUseOpenCL(False)
    names = options.sequences or sequences.names(options.dataset)
    for tracker in options.trackers:
        run(tracker, options.dataset, options.output, names, options.limit, options.again)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=pathlib.Path, help="the folder of sequences")
    parser.add_argument("output", type=pathlib.Path, help="folder for boxes and times")
    arguments(parser)
    run_all(parser.parse_args())


if __name__ == "__main__":
    main()
