"""Pairs of a template and a search window: what the trunk sees in both, where the target is, and what a teacher says.

The teacher is a published pair of networks that finds a template in a window. It judges objects that nobody marked: any
textured box of a picture is a target if the teacher finds it again in an altered look at the picture.
"""

import json
import pathlib
import time

import cv2
import numpy as np
import onnx
import onnxruntime

# Sides in pixels: see src/network/matching.rs. The middle of the CELLS x CELLS places, STRIDE apart, is the window's.
TEMPLATE, WINDOW, CELLS, STRIDE = 96, 192, 11, 16
# Fields of a shard: shape of one pair, and type.
FIELDS = {
    "template_deep": ((112, 6, 6), np.float16),
    "template_fine": ((40, 12, 12), np.float16),
    "window_deep": ((112, 12, 12), np.float16),
    "window_fine": ((40, 24, 24), np.float16),
    # How much the teacher sees the target at each place, 0 to 1.
    "soft": ((CELLS, CELLS), np.float16),
    # Left, top, right, bottom in pixels of the window: the teacher's best box, and the truth (NaN: not there).
    "teacher": ((4,), np.float32),
    "truth": ((4,), np.float32),
    # Kind, number of the recording (-1: a picture), overlap of the teacher's box with the truth.
    "about": ((3,), np.float32),
}
MARKED, OBJECT_OF_VIDEO, OBJECT_OF_PICTURE, ABSENT = range(4)
PAIRS_OF_A_SHARD = 1000
LARGEST_PICTURE = 1600
PICTURES = {".jpg", ".jpeg", ".png", ".webp"}


def session(model):
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    return onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])


class Trunk:
    """The embedded network."""

    def __init__(self, path):
        self.network = session(str(path))

    def features(self, patch):
        image = (patch[:, :, ::-1].transpose(2, 0, 1)[None].astype(np.float32) - 127) / 128
        return [maps[0] for maps in self.network.run(["block10", "block4"], {"image": np.ascontiguousarray(image)})]


class Teacher:
    """A published pair of networks: images blue, green, red, 0 to 255; windows of 255 px, templates of 127."""

    TEMPLATE, WINDOW = 127, 255

    def __init__(self, backbone, head):
        model = onnx.load(str(backbone))
        for tensor in (model.graph.input[0], model.graph.output[0]):
            for axis in (2, 3):
                tensor.type.tensor_type.shape.dim[axis].Clear()
        del model.graph.value_info[:]
        self.backbone, self.head = session(model.SerializeToString()), session(str(head))
        self.inputs = [tensor.name for tensor in self.head.get_inputs()]

    def features(self, patch):
        name = self.backbone.get_inputs()[0].name
        return self.backbone.run(None, {name: patch.transpose(2, 0, 1)[None].astype(np.float32)})[0]

    def find(self, template, patch):
        """Probability by place, and boxes: left, top, right, bottom from the window's middle, in its pixels."""
        logits, sides = self.head.run(None, dict(zip(self.inputs, (self.features(template), self.features(patch)))))
        probability = 1 / (1 + np.exp(logits[0, 0] - logits[0, 1]))
        places = (np.arange(len(probability)) - len(probability) // 2) * float(STRIDE)
        x, y = np.meshgrid(places, places)
        left, top, right, bottom = sides[0]
        return probability, np.stack([x - left, y - top, x + right, y + bottom])


def side_with_context(size):
    """The side of a teacher's template, half of the mean of width and height around the target."""
    return np.sqrt((size[0] + size.mean(0)) * (size[1] + size.mean(0)))


class View:
    """A look at an image: the square of `side` pixels around `centre` as `out` pixels; stretched, mirrored, turned."""

    def __init__(self, centre, side, out, stretch=1.0, mirrored=False, turn=0.0):
        scale, cos, sin = out / side, np.cos(turn), np.sin(turn)
        along = np.diag([scale * stretch * (-1 if mirrored else 1), scale / stretch])
        self.linear = np.array([[cos, -sin], [sin, cos]]) @ along
        self.offset = out / 2 - 0.5 - self.linear @ (np.asarray(centre) - 0.5)
        self.out = out

    def crop(self, image, outside=None):
        """Beyond the image `outside`, without averaging, as for the teacher; or border pixels, averaged when shrunk."""
        linear, offset, border = self.linear, self.offset, dict(borderMode=cv2.BORDER_CONSTANT, borderValue=outside)
        if outside is None:
            image, linear, offset = self.shrunk(image)
            border = dict(borderMode=cv2.BORDER_REPLICATE)
        matrix = np.hstack([linear, offset[:, None]])
        return cv2.warpAffine(image, matrix, (self.out, self.out), flags=cv2.INTER_LINEAR, **border)

    def shrunk(self, image):
        scale = np.sqrt(abs(np.linalg.det(self.linear)))
        if scale >= 0.8:
            return image, self.linear, self.offset
        corners = np.array([[0, 0, self.out, self.out], [0, self.out, 0, self.out]]) - self.offset[:, None]
        corners = np.linalg.inv(self.linear) @ corners
        most = np.array(image.shape[1::-1]) - 1
        first = np.minimum((np.floor(corners.min(1)) - 4).clip(0), most).astype(int)
        last = np.maximum(np.ceil(corners.max(1)).astype(int) + 5, first + 1)
        part = image[first[1] : last[1], first[0] : last[0]]
        size = np.maximum(1, np.rint(np.array(part.shape[1::-1]) * scale)).astype(int)
        factor = size / np.array(part.shape[1::-1])
        small = cv2.resize(part, size.tolist(), interpolation=cv2.INTER_AREA)
        offset = self.offset + self.linear @ (first - 0.5 + 0.5 / factor)
        return small, self.linear @ np.diag(1 / factor), offset

    def box(self, rect):
        """Left, top, right, bottom of x, y, width, height."""
        centre = self.linear @ (rect[:2] + rect[2:] / 2 - 0.5) + self.offset + 0.5
        half = rect[2:] / 2 * np.hypot(*self.linear)
        return np.concatenate([centre - half, centre + half])


def overlap(a, b):
    """Intersection over union of boxes left, top, right, bottom."""
    inside = np.clip(np.minimum(a[2:], b[2:]) - np.maximum(a[:2], b[:2]), 0, None).prod(0)
    return inside / np.maximum((a[2:] - a[:2]).prod(0) + (b[2:] - b[:2]).prod(0) - inside, 1e-9)


def altered(random):
    """A change of light, colour and sharpness."""
    gamma, gain, lift = np.exp(random.normal(0, 0.15)), 1 + random.normal(0, 0.15), random.normal(0, 12)
    ramp = 255 * (np.arange(256) / 255) ** gamma * gain
    table = np.clip(ramp[:, None] * (1 + random.normal(0, 0.04, 3)) + lift, 0, 255).astype(np.uint8)[:, None]
    kind, sigma = random.random(), random.uniform(0.5, 1.8)
    length, angle = int(random.integers(3, 10)), random.uniform(0, np.pi)
    noise, seed = random.uniform(2, 10) if random.random() < 0.15 else 0, int(random.integers(1 << 30))

    def apply(patch):
        patch = cv2.LUT(patch, table)
        if kind < 0.12:
            patch = cv2.GaussianBlur(patch, (0, 0), sigma)
        elif kind < 0.25:
            kernel, middle = np.zeros((length, length), np.float32), (length - 1) / 2
            way = middle * np.array([np.cos(angle), np.sin(angle)])
            ends = [tuple(np.rint(middle + sign * way).astype(int).tolist()) for sign in (-1, 1)]
            cv2.line(kernel, *ends, 1.0)
            patch = cv2.filter2D(patch, -1, kernel / kernel.sum())
        if noise:
            patch = np.clip(patch + np.random.default_rng(seed).normal(0, noise, patch.shape), 0, 255).astype(np.uint8)
        return patch

    return apply


def grey(image):
    return cv2.cvtColor(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR)


class Images:
    """Reads images, and keeps the last few."""

    def __init__(self):
        self.kept = {}

    def read(self, path):
        if path not in self.kept:
            if len(self.kept) > 40:
                self.kept.clear()
            image = cv2.imread(str(path))
            if image is not None and max(image.shape[:2]) > LARGEST_PICTURE:
                factor = LARGEST_PICTURE / max(image.shape[:2])
                image = cv2.resize(image, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
            self.kept[path] = image
        return self.kept[path]


def recordings(folders):
    """Folders of video with boxes, as `evaluate` reads them, by name: images, boxes, and which rows are good."""
    found = []
    for folder in sorted(path for root in folders for path in pathlib.Path(root).iterdir()):
        truth = folder / "groundtruth_rect.txt"
        if not truth.is_file():
            continue
        rows = [row.replace("\t", ",").split(",") for row in truth.read_text().splitlines() if row.strip()]
        boxes = np.array(rows, dtype=float)
        files = sorted((folder / "img").iterdir()) if (folder / "img").is_dir() else sorted(folder.glob("*.jpg"))
        count = min(len(boxes), len(files))
        good = np.isfinite(boxes[:count]).all(1) & (boxes[:count, 2:] > 3).all(1)
        hidden = folder / "occlusion.txt"
        if hidden.is_file():
            share = [float(row.split(",")[-1]) for row in hidden.read_text().splitlines() if row.strip()]
            good[: len(share)] &= np.array(share[:count]) < 0.5
        if good.any():
            found.append((folder.name, files[:count], boxes[:count], np.flatnonzero(good)))
    return found


def pictures(folders):
    found = (path for root in folders for path in pathlib.Path(root).rglob("*"))
    return sorted(path for path in found if path.suffix.lower() in PICTURES and path.is_file())


def textured_box(random, image):
    """A box of any shape where there is something to see: x, y, width, height."""
    high, wide = image.shape[:2]
    scale = np.exp(random.uniform(np.log(16), np.log(max(20, 0.35 * min(high, wide)))))
    aspect = np.exp(random.normal(0, 0.45) / 2)
    size = np.minimum([scale * aspect, scale / aspect], [wide - 1, high - 1])
    for _ in range(12):
        corner = random.uniform(0, np.maximum(1, [wide, high] - size))
        (x, y), (right, bottom) = corner.astype(int), (corner + size).astype(int) + 1
        if image[y:bottom, x:right].std() > 18:
            break
    return np.concatenate([corner, size])


class Shard:
    """Pairs that are made together."""

    def __init__(self, folder, count):
        folder.mkdir(parents=True, exist_ok=True)
        array = lambda name, shape, kind: np.lib.format.open_memmap(folder / f"{name}.npy", "w+", kind, (count, *shape))
        self.fields = {name: array(name, *what) for name, what in FIELDS.items()}
        self.count, self.filled = count, 0

    def is_full(self):
        return self.filled == self.count

    def add(self, **values):
        for name, value in values.items():
            self.fields[name][self.filled] = value
        self.filled += 1


class Maker:
    """Makes the pairs of one shard."""

    def __init__(self, trunk, teacher, shard, random):
        self.trunk, self.teacher, self.shard, self.random = trunk, teacher, shard, random

    def pair(self, images, boxes, kind, source):
        """The target in the first image and its first box, and a window of the second. Of an absent target, the second
        box tells where the window is. Whether the pair is of use."""
        random = self.random
        mirrored, is_grey = random.random() < 0.5, random.random() < 0.15
        size, place = boxes[1][2:], boxes[1][:2] + boxes[1][2:] / 2
        zoom, area = np.exp(random.normal(0, 0.18)), 2 * np.sqrt(size.prod())
        if kind != ABSENT:
            reach = random.choice([0.15, 0.5, 1.0], p=[0.45, 0.35, 0.2])
            place = place + random.uniform(-1, 1, 2) * reach * 0.75 * area * zoom
        turn = random.normal(0, 0.1) if random.random() < 0.3 else 0.0
        change = dict(stretch=np.exp(random.normal(0, 0.08)), mirrored=mirrored, turn=turn)
        own = 2 * area * zoom
        theirs = side_with_context(size) * zoom * self.teacher.WINDOW / self.teacher.TEMPLATE
        views = View(place, own, WINDOW, **change), View(place, theirs, self.teacher.WINDOW, **change)
        marked = boxes[0][:2] + boxes[0][2:] / 2
        jitter = np.exp(random.normal(0, 0.03))
        templates = (
            View(marked, 2 * np.sqrt(boxes[0][2:].prod()) * jitter, TEMPLATE, mirrored=mirrored),
            View(marked, side_with_context(boxes[0][2:]), self.teacher.TEMPLATE, mirrored=mirrored),
        )
        looks = altered(random), altered(random)
        shown = [grey(image) if is_grey else image for image in images]
        outside = [cv2.mean(image)[:3] for image in shown]
        probability, found = self.teacher.find(
            looks[0](templates[1].crop(shown[0], outside[0])), looks[1](views[1].crop(shown[1], outside[1]))
        )
        # From pixels of the teacher's window to those of ours.
        unit = theirs / self.teacher.WINDOW / (own / WINDOW)
        found = found * unit + WINDOW / 2
        best = np.unravel_index(probability.argmax(), probability.shape)
        teacher, truth, agreed = found[:, best[0], best[1]], np.full(4, np.nan), 0.0
        if kind != ABSENT:
            truth = views[0].box(boxes[1])
            agreed = overlap(teacher, truth)
            if kind != MARKED and (agreed < 0.6 or probability.max() < 0.6):
                return False
        known = truth if kind == MARKED else teacher
        sees = probability * (overlap(found, known[:, None, None]) > 0.4) if kind != ABSENT else 0 * probability
        places = len(probability) // 2 + (np.arange(CELLS) - CELLS // 2) / unit
        across, down = np.meshgrid(places.astype(np.float32), places.astype(np.float32))
        template = self.trunk.features(looks[0](templates[0].crop(shown[0])))
        window = self.trunk.features(looks[1](views[0].crop(shown[1])))
        self.shard.add(
            template_deep=template[0],
            template_fine=template[1],
            window_deep=window[0],
            window_fine=window[1],
            soft=cv2.remap(sees.astype(np.float32), across, down, cv2.INTER_LINEAR, borderValue=0),
            teacher=teacher,
            truth=truth,
            about=(kind, source, agreed),
        )
        return True

    def elsewhere(self, image, box):
        """A box of the same size in whose window the target is not, if one is found."""
        side, middle = 2 * np.sqrt(box[2:].prod()), box[:2] + box[2:] / 2
        for _ in range(10):
            angle, way = self.random.uniform(0, 2 * np.pi), self.random.uniform(1.2, 3.0) * side
            place = middle + way * np.array([np.cos(angle), np.sin(angle)])
            is_inside = (place > 0).all() and (place < image.shape[1::-1]).all()
            if is_inside and (np.abs(place - middle) > 1.02 * side + box[2:] / 2).any():
                return np.concatenate([place - box[2:] / 2, box[2:]])
        return None

    def of_recording(self, images, recording, source):
        """A marked target in two frames, where it is not, and other objects of the same frames."""
        random, (_, files, boxes, good) = self.random, recording
        first = random.choice(good)
        gap = int(np.exp(random.uniform(0, np.log(150)))) * random.choice([-1, 1])
        second = good[np.abs(good - (first + gap)).argmin()]
        shown = [images.read(files[at]) for at in (first, second)]
        if any(image is None for image in shown):
            return
        jobs = [(shown, [boxes[first], boxes[second]], MARKED)]
        if random.random() < 0.6 and (absent := self.elsewhere(shown[1], boxes[second])) is not None:
            jobs.append((shown, [boxes[first], absent], ABSENT))
        for _ in range(random.binomial(2, 0.5)):
            box = textured_box(random, shown[0])
            is_near = abs(gap) <= 3 and random.random() < 0.4
            jobs.append(([shown[0], shown[1] if is_near else shown[0]], [box, box], OBJECT_OF_VIDEO))
        for images_of, boxes_of, kind in jobs:
            if not self.shard.is_full():
                self.pair(images_of, boxes_of, kind, source)

    def of_picture(self, image):
        """Objects of a picture, and where they are not."""
        for _ in range(4):
            if self.shard.is_full():
                return
            box = textured_box(self.random, image)
            found = self.pair([image] * 2, [box, box], OBJECT_OF_PICTURE, -1)
            if found and not self.shard.is_full() and self.random.random() < 0.2:
                if (absent := self.elsewhere(image, box)) is not None:
                    self.pair([image] * 2, [box, absent], ABSENT, -1)


def make(out, count, seed, trunk, teacher, video, stills, share_of_stills=0.28):
    """Makes `count` pairs in shards; those that are there already stay."""
    known, images = recordings(video), Images()
    (out / "recordings.json").write_text(json.dumps([name for name, *_ in known]))
    weights = np.sqrt([len(good) for *_, good in known])
    begun = time.monotonic()
    for number, first in enumerate(range(0, count, PAIRS_OF_A_SHARD)):
        folder, done = out / f"{number:04}", out / f"{number:04}" / "done"
        if done.exists():
            continue
        shard = Shard(folder, min(PAIRS_OF_A_SHARD, count - first))
        maker = Maker(trunk, teacher, shard, np.random.default_rng([seed, number]))
        while not shard.is_full():
            if stills and (not known or maker.random.random() < share_of_stills):
                image = images.read(stills[maker.random.integers(len(stills))])
                if image is not None and min(image.shape[:2]) >= 64:
                    maker.of_picture(image)
            else:
                source = maker.random.choice(len(known), p=weights / weights.sum())
                maker.of_recording(images, known[source], source)
        for field in shard.fields.values():
            field.flush()
        done.touch()
        print(f"{first + shard.count} of {count} pairs, {time.monotonic() - begun:.0f} s", flush=True)
