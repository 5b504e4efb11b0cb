"""Rows in the format of MOTChallenge, and how good they are: HOTA, MOTA, IDF1 and identity switches by TrackEval, and the
counts of MAPTrack's table 2."""

import collections

import numpy as np
from scipy.optimize import linear_sum_assignment
from trackeval.metrics import CLEAR, HOTA, Identity

# Frame, id, x, y, width, height and a confidence; in a truth, rows whose confidence is 0 do not count.
FRAME, ID, BOX, CONFIDENCE = 0, 1, slice(2, 6), 6
# Smith et al. (Evaluating multi-object tracking, 2005) call a box covered by another if recall and precision of its area
# have a harmonic mean above a third, whatever else the other covers; MAPTrack's paper takes its measure from there.
COVERED = 1 / 3
# The usual one.
IOU = 0.5


def read(path):
    """The rows of a file as an array of shape (rows, columns); without any, of shape (0, 10)."""
    lines = [line for line in path.read_text().splitlines() if line.strip()]
    return np.array([[float(v) for v in line.split(",")] for line in lines]).reshape(len(lines), -1 if lines else 10)


def write(path, rows):
    """Writes rows of frame, id, x, y, w, h, confidence."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w") as file:
        for frame, identity, *numbers in rows:
            file.write(f"{int(frame)},{int(identity)},{','.join(f'{v:.3f}' for v in numbers)},-1,-1,-1\n")


def overlaps(a, b):
    """The area that each of the boxes a shares with each of b, and the sums of their areas."""
    low = np.maximum(a[:, None, :2], b[None, :, :2])
    high = np.minimum(a[:, None, :2] + a[:, None, 2:], b[None, :, :2] + b[None, :, 2:])
    shared = np.prod(np.clip(high - low, 0, None), axis=2)
    return shared, np.prod(a[:, None, 2:], axis=2) + np.prod(b[None, :, 2:], axis=2)


def iou(a, b):
    """Intersection over union of each of the boxes a with each of b."""
    shared, areas = overlaps(a, b)
    return shared / (areas - shared)


def coverage(a, b):
    """The harmonic mean of recall and precision, likewise."""
    shared, areas = overlaps(a, b)
    return 2 * shared / areas


def by_frame(rows, frames):
    """The rows of each frame from 1 on, with identities counted from 0."""
    names = {name: i for i, name in enumerate(np.unique(rows[:, ID]))}
    split = [rows[rows[:, FRAME] == frame] for frame in range(1, frames + 1)]
    return [(np.array([names[i] for i in part[:, ID]], int), part[:, BOX]) for part in split], len(names)


def match(similarity, least):
    """The one-to-one pairs of rows and columns with the greatest sum of what is at least that similar."""
    usable = np.where(similarity >= least, similarity, 0)
    pairs = zip(*linear_sum_assignment(-usable), strict=True)
    return [(i, j) for i, j in pairs if usable[i, j] > 0]


def standard(truth, rows, frames):
    """The standard scores, in percent, and counts."""
    (truth_frames, people), (frames_of, tracks) = by_frame(truth, frames), by_frame(rows, frames)
    data = {
        "num_timesteps": frames,
        "num_gt_ids": people,
        "num_tracker_ids": tracks,
        "num_gt_dets": len(truth),
        "num_tracker_dets": len(rows),
        "gt_ids": [ids for ids, _ in truth_frames],
        "tracker_ids": [ids for ids, _ in frames_of],
        "similarity_scores": [iou(a, b) for (_, a), (_, b) in zip(truth_frames, frames_of, strict=True)],
    }
    quiet = {"PRINT_CONFIG": False}
    hota = HOTA().eval_sequence(data)
    clear = CLEAR(quiet).eval_sequence(data)
    identity = Identity(quiet).eval_sequence(data)
    return {
        "HOTA": 100 * float(np.mean(hota["HOTA"])),
        "MOTA": 100 * float(clear["MOTA"]),
        "IDF1": 100 * float(identity["IDF1"]),
        "switches": int(clear["IDSW"]),
        "missed": int(clear["CLR_FN"]),
        "false": int(clear["CLR_FP"]),
        "tracks": tracks,
    }


def table2(truth, rows, frames):
    """What the paper's table 2 counts, as we read it, by the coverage of Smith et al.: correct, the boxes of the truth that a
    track's box covers; false, the tracks that never cover a person. Also the boxes that cover none, and how many of the
    correct ones are left if a track's box may stand for one person only, by coverage and by IoU."""
    (truth_frames, _), (frames_of, tracks) = by_frame(truth, frames), by_frame(rows, frames)
    counts = collections.Counter(boxes=len(truth))
    right = set()
    for (_, people), (ids, boxes) in zip(truth_frames, frames_of, strict=True):
        covers = coverage(people, boxes) > COVERED
        right |= set(ids[covers.any(axis=0)].tolist())
        counts["correct"] += int(covers.any(axis=1).sum())
        counts["one_to_one"] += len(match(coverage(people, boxes), COVERED))
        counts["one_to_one_iou"] += len(match(iou(people, boxes), IOU))
        counts["false_boxes"] += int((~covers.any(axis=0)).sum())
    return {**counts, "false_tracks": tracks - len(right)}


def score(truth, rows, frames):
    """All scores of a tracker's rows."""
    truth = truth[truth[:, CONFIDENCE] != 0]
    return {**standard(truth, rows, frames), "table2": table2(truth, rows, frames)}
