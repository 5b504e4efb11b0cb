"""Follows marked targets with a head alone, as a short-term tracker: each box from the one before."""

import cv2
import numpy as np

from pairs import CELLS, STRIDE, TEMPLATE, WINDOW, View, recordings, session, side_with_context

# Share of a cosine window in the value of a place, what a change of size costs, and how much of a new size one frame
# takes over at most: as NanoTrack V3 is published.
INFLUENCE, PENALTY, RATE = 0.455, 0.138, 0.348
LEAST_SIDE = 10


class Follower:
    """One target: its middle and its size."""

    def __init__(self, trunk, head, image, box):
        self.trunk, self.head = trunk, head
        self.inputs = [tensor.name for tensor in head.get_inputs()]
        self.middle, self.size = box[:2] + box[2:] / 2, box[2:]
        self.template = self.look(image, TEMPLATE)
        line = np.hanning(CELLS)
        self.near = np.outer(line, line)
        steps = (np.arange(CELLS) - CELLS // 2) * float(STRIDE)
        self.places = np.stack(np.meshgrid(steps, steps))

    def unit(self):
        """A pixel of template and window, in pixels of the image."""
        return 2 * np.sqrt(self.size.prod()) / TEMPLATE

    def look(self, image, pixels):
        patch = View(self.middle, pixels * self.unit(), pixels).crop(image)
        return [maps[None] for maps in self.trunk.features(patch)]

    def step(self, image):
        """The target's box in the next image: x, y, width, height."""
        maps = self.template + self.look(image, WINDOW)
        logits, sides = self.head.run(None, dict(zip(self.inputs, maps)))
        score = 1 / (1 + np.exp(logits[0, 0] - logits[0, 1]))
        sizes = (sides[0, :2] + sides[0, 2:]) * self.unit()
        middles = (self.places + (sides[0, 2:] - sides[0, :2]) / 2) * self.unit()
        change = side_with_context(sizes) / side_with_context(self.size)
        aspect = sizes[0] / sizes[1] / (self.size[0] / self.size[1])
        change, aspect = np.maximum(change, 1 / change), np.maximum(aspect, 1 / aspect)
        score = score * np.exp(-PENALTY * (change * aspect - 1))
        value = score * (1 - INFLUENCE) + self.near * INFLUENCE
        row, column = np.unravel_index(value.argmax(), value.shape)
        limits = np.array(image.shape[1::-1], float)
        self.middle = np.clip(self.middle + middles[:, row, column], 0, limits)
        size = self.size + RATE * score[row, column] * (sizes[:, row, column] - self.size)
        self.size = np.clip(size, LEAST_SIDE, np.maximum(LEAST_SIDE, limits))
        return np.concatenate([self.middle - self.size / 2, self.size])


def follow(trunk, head, video, names, out):
    """Writes the boxes of each recording to a file that `evaluate --peer` reads."""
    head = session(str(head))
    out.mkdir(parents=True, exist_ok=True)
    for name, files, boxes, good in recordings(video):
        if names and name not in names:
            continue
        found, follower = [], None
        for at, file in enumerate(files):
            image = cv2.imread(str(file))
            if follower:
                found.append(follower.step(image))
            elif at == good[0]:
                follower = Follower(trunk, head, image, boxes[at])
                found.append(boxes[at])
            else:
                found.append(np.full(4, np.nan))
        np.savetxt(out / f"{name}.txt", found, "%.2f", ",")
        print(f"{name}, {len(found)} frames", flush=True)
