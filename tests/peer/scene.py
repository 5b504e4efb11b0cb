"""What the camera of the tests sees, and the boxes in it."""

import numpy as np

WIDTH, HEIGHT = 320, 240
TARGET = (40, 48)


class Scene:
    """A textured target that moves over a textured background; every frame is the same in every run."""

    def __init__(self, width=WIDTH, height=HEIGHT, target=TARGET):
        rng = np.random.default_rng(7)
        self.width, self.height, self.target = width, height, target
        self.background = self._texture(rng, height, width, 8, 60, 120)
        self.patch = self._texture(rng, target[1], target[0], 6, 90, 255)
        # The frames in which the target is not there.
        self.hidden = ()

    @staticmethod
    def _texture(rng, height, width, cell, low, high):
        coarse = rng.integers(low, high, (height // cell + 1, width // cell + 1, 3), dtype=np.uint8)
        return np.kron(coarse, np.ones((cell, cell, 1), dtype=np.uint8))[:height, :width]

    def box(self, index):
        """x, y, width, height of the target."""
        phase = index / 20.0
        x = round((self.width - self.target[0]) * (0.5 + 0.3 * np.sin(phase)))
        y = round((self.height - self.target[1]) * (0.5 + 0.2 * np.sin(0.7 * phase)))
        return x, y, *self.target

    def rgb(self, index):
        x, y, w, h = self.box(index)
        frame = self.background.copy()
        if index not in self.hidden:
            frame[y : y + h, x : x + w] = self.patch
        return frame


def iou(a, b):
    """Intersection over union of two boxes x, y, width, height."""
    w = min(a[0] + a[2], b[0] + b[2]) - max(a[0], b[0])
    h = min(a[1] + a[3], b[1] + b[3]) - max(a[1], b[1])
    shared = max(w, 0) * max(h, 0)
    return shared / (a[2] * a[3] + b[2] * b[3] - shared)


def box_of(track):
    return (
        track.center_x - track.size_x / 2,
        track.center_y - track.size_y / 2,
        track.size_x,
        track.size_y,
    )
