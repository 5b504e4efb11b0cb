"""Prints what a head in training answers to the pictures of a template and a window: logits, and distances."""

import pathlib
import sys

import cv2
import torch

ASSETS = pathlib.Path(__file__).parents[2] / "assets"
sys.path.insert(0, str(ASSETS / "matching"))
from head import Head
from pairs import Trunk

state, *pictures = sys.argv[1:]
torch.set_num_threads(1)
head = Head()
head.load_state_dict(torch.load(state)["head"])
head.eval()
trunk = Trunk(ASSETS / "lite0.onnx")
maps = [torch.from_numpy(seen)[None] for picture in pictures for seen in trunk.features(cv2.imread(picture))]
with torch.no_grad():
    logits, sides = head(*maps)
print(*logits.flatten().tolist(), *sides.flatten().tolist())
