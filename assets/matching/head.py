"""The head: how much each place of a window looks like the template, and where the target's sides are.

Template and window are maps of the trunk: deep (block 10, stride 16) and fine (block 4, stride 8).
"""

import torch
from torch import nn
from torch.nn import functional

from pairs import CELLS, STRIDE, WINDOW

CHANNELS = 96
# Cells along a side of template and window.
TEMPLATE_CELLS, WINDOW_CELLS = 6, 12
# The sides are exponentials, in units of so many pixels.
UNIT = 32.0
# Wrong places of a window that count again.
HARDEST = 8


def block(inputs, outputs, kernel=3):
    convolution = nn.Conv2d(inputs, outputs, kernel, padding=kernel // 2, bias=False)
    return nn.Sequential(convolution, nn.BatchNorm2d(outputs), nn.ReLU())


class Adapter(nn.Module):
    """Both maps on one grid."""

    def __init__(self):
        super().__init__()
        self.deep = nn.Conv2d(112, CHANNELS, 1, bias=False)
        self.fine = nn.Conv2d(40, CHANNELS, 2, stride=2, bias=False)
        self.norm = nn.BatchNorm2d(CHANNELS)

    def forward(self, deep, fine):
        return self.norm(self.deep(deep) + self.fine(fine))


class Head(nn.Module):
    def __init__(self):
        super().__init__()
        self.adapter = Adapter()
        self.gate = nn.Linear(CHANNELS, CHANNELS)
        self.alike = nn.BatchNorm2d(TEMPLATE_CELLS**2)
        self.fuse = block(TEMPLATE_CELLS**2 + 2 * CHANNELS, CHANNELS, 1)
        self.tower = nn.ModuleList([block(CHANNELS, CHANNELS) for _ in range(3)])
        self.score = nn.Sequential(block(CHANNELS, 48), nn.Conv2d(48, 1, 1))
        self.sides = nn.Sequential(block(CHANNELS, 64), nn.Conv2d(64, 4, 1))

    def forward(self, template_deep, template_fine, window_deep, window_fine):
        """Logits, n x CELLS x CELLS, and distances to left, top, right, bottom, n x 4 x CELLS x CELLS."""
        template, window = self.adapter(template_deep, template_fine), self.adapter(window_deep, window_fine)
        # Each cell of the window against each of the template: pixel-wise correlation (Yan et al., Alpha-Refine, 2021).
        columns = template.flatten(2).transpose(1, 2)
        alike = torch.matmul(columns, window.flatten(2)) / CHANNELS
        alike = self.alike(alike.unflatten(2, (WINDOW_CELLS, WINDOW_CELLS)))
        gate = torch.sigmoid(self.gate(template[:, :, 1:-1, 1:-1].mean((2, 3))))[:, :, None, None]
        features = self.fuse(torch.cat([alike, window * gate, window], 1))
        for layer in self.tower:
            features = features + layer(features)
        sides = torch.exp(self.sides(features)[:, :, :CELLS, :CELLS].clamp(-6, 3)) * UNIT
        return self.score(features)[:, 0, :CELLS, :CELLS], sides


def places():
    """The places of the answer, in pixels of the window: across and down."""
    line = (torch.arange(CELLS) - CELLS // 2) * float(STRIDE) + WINDOW / 2
    return line[None, None, :], line[None, :, None]


def boxes(sides):
    """Left, top, right, bottom by place."""
    x, y = places()
    return torch.stack([x - sides[:, 0], y - sides[:, 1], x + sides[:, 2], y + sides[:, 3]], 1)


def overlap(a, b, generalised=False):
    """Intersection over union along axis 1, or the generalised one (Rezatofighi et al., CVPR 2019)."""
    inside = (torch.minimum(a[:, 2:], b[:, 2:]) - torch.maximum(a[:, :2], b[:, :2])).clamp(min=0).prod(1)
    area = lambda box: (box[:, 2:] - box[:, :2]).clamp(min=0).prod(1)
    union = area(a) + area(b) - inside + 1e-6
    if not generalised:
        return inside / union
    hull = (torch.maximum(a[:, 2:], b[:, 2:]) - torch.minimum(a[:, :2], b[:, :2])).prod(1) + 1e-6
    return inside / union - (hull - union) / hull


def best_box(logits, sides):
    """The box of the place with the highest score."""
    best = logits.flatten(1).argmax(1)
    return boxes(sides).flatten(2)[torch.arange(len(best)), :, best]


def loss(head, pairs):
    """Cross-entropy of the places, in which the hardest wrong ones count again, and overlap of the boxes."""
    logits, sides = head(*(pairs[name] for name in ("template_deep", "template_fine", "window_deep", "window_fine")))
    truth, agreed = pairs["truth"], pairs["about"][:, 2]
    is_there = torch.isfinite(truth[:, 0])
    truth = torch.nan_to_num(truth, nan=-1e4)[:, :, None, None]
    x, y = places()
    middle, size = (truth[:, :2] + truth[:, 2:]) / 2, (truth[:, 2:] - truth[:, :2]).clamp(min=20)
    inner = (((x - middle[:, 0]) / size[:, 0]) ** 2 + ((y - middle[:, 1]) / size[:, 1]) ** 2 < 0.3**2).float()
    # Where the teacher is wrong, the truth alone counts.
    is_wrong = (agreed < 0.45)[:, None, None]
    label = torch.where(is_wrong, inner, torch.maximum(pairs["soft"], inner * 0.5)) * is_there[:, None, None]
    entropy = functional.binary_cross_entropy_with_logits(logits, label, reduction="none").flatten(1)
    label = label.flatten(1)
    wrong = entropy * (label < 0.1)
    place = (entropy * label).sum(1) / label.sum(1).clamp(min=0.5)
    place = place + 0.5 * wrong.mean(1) + 0.5 * wrong.topk(HARDEST, 1)[0].mean(1)
    # Marked targets have the truth's box, objects the teacher's.
    is_marked = (pairs["about"][:, 0] == 0)[:, None]
    target = torch.where(is_marked, torch.nan_to_num(pairs["truth"]), pairs["teacher"])[:, :, None, None]
    found = boxes(sides)
    off = (1 - overlap(found, target.expand_as(found), generalised=True)).flatten(1)
    weight = label * (label > 0.2)
    box = (off * weight).sum(1) / weight.sum(1).clamp(min=0.5) * is_there
    return place.mean() + 1.5 * box.sum() / is_there.sum().clamp(min=1)
