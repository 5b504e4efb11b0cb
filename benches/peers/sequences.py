"""Sequences as `evaluate` reads them: a folder with images, in img/ or not, and a groundtruth_rect.txt."""

import pathlib
import re
import sys

import cv2
import numpy as np

TRUTH = "groundtruth_rect.txt"
IMAGES = {".jpg", ".jpeg", ".png"}
# A file of at most so many bytes may be a link in writing; no image is that small.
MAX_LINK = 1024


def names(dataset):
    """The sequences of a folder, by the numbers in their names."""
    found = sorted((path.parent.name for path in dataset.glob(f"*/{TRUTH}")), key=natural)
    if not found:
        sys.exit(f"{dataset}: no sequences (folders with a {TRUTH}) in the folder")
    return found


def natural(name):
    """A sorting key that puts 10 after 9."""
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", name)]


def read_truth(sequence):
    """Rows of x, y, w, h as an array of shape (frames, 4); NaN where the target is not in view."""
    lines = [line for line in (sequence / TRUTH).read_text().splitlines() if line.strip()]
    return np.array([[float(v) for v in re.split(r"[,\s]+", line.strip())] for line in lines])


def images(sequence):
    """The paths of the images, in order."""
    folder = sequence / "img" if (sequence / "img").is_dir() else sequence
    found = [p for p in folder.iterdir() if p.suffix.lower() in IMAGES and not p.name.startswith(".")]
    return sorted(found, key=lambda path: natural(path.name))


def read_image(path):
    """The image in BGR. A small file that holds the path of an image stands for that one, as archives without
    symbolic links have it."""
    data = path.read_bytes()
    if len(data) <= MAX_LINK and pathlib.PurePath(data.decode("utf-8", "replace").strip()).suffix.lower() in IMAGES:
        data = (path.parent / data.decode().strip()).read_bytes()
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    if image is None:
        sys.exit(f"{path}: not an image")
    return image
