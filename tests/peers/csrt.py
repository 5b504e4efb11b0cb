#!/usr/bin/env python3
"""Runs OpenCV's CSRT tracker with its default settings, to compare speed and accuracy with it.

    pip install -r tests/peers/requirements.txt
    SEQUENCES_DIR=... python3 tests/peers/csrt.py [--limit FRAMES] [NAME ...]

SEQUENCES_DIR holds one folder a sequence: img/ and groundtruth_rect.txt (x,y,w,h a row; NaN = absent). Without
names all of them are run. One thread is used; fps counts its processor time, reading and decoding left out, as
`evaluate` does. Figures follow the rules of the object tracking benchmark: precision is the share of rows whose
centres are at most 20 px apart, AUC the area under the success curve over 21 overlaps; rows without ground truth are
skipped.
"""

import argparse
import math
import os
import pathlib
import sys
import time

import cv2
import numpy as np

PRECISION_PIXELS = 20.0
OVERLAPS = np.linspace(0.0, 1.0, 21)


def read_boxes(path):
    """Rows of x, y, w, h as an array of shape (frames, 4)."""
    lines = [line for line in path.read_text().splitlines() if line.strip()]
    return np.array([[float(v) for v in line.replace(",", " ").split()] for line in lines])


def read_image(path):
    """The image in BGR. A link that was checked out as a text file with the path in it is followed."""
    data = path.read_bytes()
    if data.startswith(b".."):
        data = (path.parent / data.decode().strip()).read_bytes()
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    if image is None:
        sys.exit(f"{path}: not an image")
    return image


def track(images, first):
    """Boxes of all images, the first included, and the seconds of processor time that the tracker took."""
    tracker = cv2.TrackerCSRT_create()
    boxes, seconds, last = [], 0.0, tuple(first)
    for index, path in enumerate(images):
        image = read_image(path)
        begin = time.process_time()
        if index == 0:
            tracker.init(image, tuple(round(v) for v in first))
        else:
            found, box = tracker.update(image)
            last = box if found else last
        seconds += time.process_time() - begin
        boxes.append(last)
    return np.array(boxes, float), seconds


def score(boxes, truth):
    """Precision at 20 px and the area under the success curve."""
    known = ~np.isnan(truth).any(axis=1)
    b, t = boxes[known], truth[known]
    distance = np.hypot(*(b[:, :2] + b[:, 2:] / 2 - t[:, :2] - t[:, 2:] / 2).T)
    low, high = np.maximum(b[:, :2], t[:, :2]), np.minimum(b[:, :2] + b[:, 2:], t[:, :2] + t[:, 2:])
    shared = np.prod(np.clip(high - low, 0, None), axis=1)
    overlap = shared / (b[:, 2:].prod(axis=1) + t[:, 2:].prod(axis=1) - shared)
    return (distance <= PRECISION_PIXELS).mean(), np.mean([(overlap > o).mean() for o in OVERLAPS])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="sequences to run; all if none is given")
    parser.add_argument("--limit", type=int, default=math.inf, help="at most this many frames of each")
    arguments = parser.parse_args()
    root = os.environ.get("SEQUENCES_DIR")
    if not root:
        parser.error("set SEQUENCES_DIR to the folder that holds the sequences")
    root = pathlib.Path(root)
    names = arguments.names or sorted(p.parent.name for p in root.glob("*/groundtruth_rect.txt"))
    cv2.setNumThreads(1)
    cv2.ocl.setUseOpenCL(False)

    print(f"OpenCV {cv2.__version__} CSRT, {cv2.getNumThreads()} thread")
    print(f"{'sequence':20} {'frames':>6} {'prec@20':>8} {'AUC':>6} {'fps':>7}")
    rows = []
    for name in names:
        truth = read_boxes(root / name / "groundtruth_rect.txt")
        images = sorted((root / name / "img").iterdir())
        count = min(len(images), len(truth), arguments.limit)
        boxes, seconds = track(images[:count], truth[0])
        rows.append((count, *score(boxes, truth[:count]), seconds))
        print(f"{name:20} {count:6} {rows[-1][1]:8.3f} {rows[-1][2]:6.3f} {count / seconds:7.1f}", flush=True)
    if not rows:
        sys.exit(f"{root}: no sequence there")
    frames, precision, auc, seconds = (np.array(column) for column in zip(*rows))
    rate = frames.sum() / seconds.sum()
    print(f"{'mean':20} {frames.sum():6} {precision.mean():8.3f} {auc.mean():6.3f} {rate:7.1f}")


if __name__ == "__main__":
    main()
