"""Trains the head that finds a marked target on maps of the embedded network (lite0.onnx), and writes matching.onnx.

    apt install python3-torch python3-venv libopenblas0-pthread
    python3 -m venv --system-site-packages venv && venv/bin/pip install -r matching/requirements.txt
    venv/bin/python train_matching.py pairs PAIRS --video RECORDINGS... --pictures PICTURES... --teacher BACKBONE HEAD
    venv/bin/python train_matching.py train HEAD.onnx --pairs PAIRS...
    venv/bin/python train_matching.py follow HEAD.onnx BOXES --video RECORDINGS...

`pairs` makes pairs of a template and a search window; `train` trains a head on them. Both go on where they were
stopped. `follow` follows the marked targets with a head alone, and writes boxes that `evaluate --peer` reads.
RECORDINGS holds a folder for each recording, as `evaluate` reads them: images, and `groundtruth_rect.txt` with
x,y,width,height a row.
"""

import argparse
import json
import math
import pathlib
import sys
import time

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).with_name("matching")))
LITE0 = pathlib.Path(__file__).with_name("lite0.onnx")
BATCH = 32
RATE, WARM_UP, LAST_SHARE = 1.5e-3, 100, 0.02
WEIGHT_DECAY, MOST_GRADIENT = 1e-2, 5.0
# Pairs on which the head is measured, and at which log lines it is.
CHECKED, CHECK_LINES = 800, 5
FOUND = 0.3


class Pairs:
    """Shards of pairs, and which recording each is of."""

    def __init__(self, folders):
        from pairs import FIELDS

        self.shards, about, names = [], [], []
        for folder in folders:
            known = json.loads((folder / "recordings.json").read_text())
            for done in sorted(folder.glob("*/done")):
                fields = {name: np.load(done.parent / f"{name}.npy", mmap_mode="r") for name in FIELDS}
                here = np.array(fields["about"])
                about.append(here)
                names += [known[int(source)] if source >= 0 else "" for source in here[:, 1]]
                self.shards.append(fields)
        self.about, self.names = np.concatenate(about), np.array(names)
        sizes = [len(shard["about"]) for shard in self.shards]
        self.place = np.concatenate([np.stack([np.full(n, i), np.arange(n)], 1) for i, n in enumerate(sizes)])

    def batch(self, index):
        import torch

        rows = self.place[np.sort(index)]
        fields = self.shards[0].keys()
        stacked = {name: np.stack([self.shards[i][name][j] for i, j in rows]) for name in fields}
        return {name: torch.from_numpy(values.astype(np.float32)) for name, values in stacked.items()}


def told(head, pairs, index):
    """How often the best box is at the target, and its overlap, beside the teacher's."""
    import torch
    from export import INPUTS
    from head import best_box, overlap

    head.eval()
    own, teacher = [], []
    with torch.no_grad():
        for first in range(0, len(index), 50):
            batch = pairs.batch(index[first : first + 50])
            own.append(overlap(best_box(*head(*(batch[name] for name in INPUTS))), batch["truth"]))
            teacher.append(batch["about"][:, 2])
    head.train()
    own, teacher = torch.cat(own), torch.cat(teacher)
    share = lambda values: f"hit {(values > FOUND).float().mean():.3f} overlap {values.mean():.3f}"
    return f"{share(own)}, teacher {share(teacher)}"


def train(options):
    import torch
    from export import check, export
    from head import Head, loss
    from pairs import MARKED

    torch.set_num_threads(options.threads)
    torch.manual_seed(options.seed)
    random = np.random.default_rng(options.seed)
    pairs = Pairs(options.pairs)
    is_left_out = np.isin(pairs.names, options.without + options.check)
    learned = np.flatnonzero(~is_left_out)
    is_checked = np.isin(pairs.names, options.check) if options.check else True
    marked = np.flatnonzero((pairs.about[:, 0] == MARKED) & is_checked)
    marked = random.permutation(marked)[:CHECKED]
    learned = learned[np.linspace(0, len(learned) - 1, round(options.share * len(learned))).astype(int)]
    if not len(learned):
        sys.exit("no pairs are left to learn")
    steps = max(1, int(options.epochs * len(learned) / BATCH))
    head = Head()
    optimiser = torch.optim.AdamW(head.parameters(), lr=RATE, weight_decay=WEIGHT_DECAY)
    order = [int(at) for _ in range(math.ceil(options.epochs) + 1) for at in random.permutation(learned)]
    first, mean, state = 0, None, options.out.with_suffix(".state")
    run = {"seed": options.seed, "steps": steps, "pairs": len(learned)}
    if state.exists():
        kept = torch.load(state)
        if kept["run"] != run:
            sys.exit(f"{state} is of a run with {kept['run']}, not {run}: remove it, or name another file")
        first, mean = kept["step"], kept["loss"]
        head.load_state_dict(kept["head"])
        optimiser.load_state_dict(kept["optimiser"])
    size = sum(values.numel() for values in head.parameters())
    print(f"{size} parameters, {len(learned)} pairs, {steps} steps from {first}, checked on {len(marked)}", flush=True)
    begun = time.monotonic()
    for step in range(first, steps):
        fall = 0.5 * (1 + math.cos(math.pi * step / steps))
        for group in optimiser.param_groups:
            group["lr"] = RATE * min(1, (step + 1) / WARM_UP) * (LAST_SHARE + (1 - LAST_SHARE) * fall)
        value = loss(head, pairs.batch(np.array(order[step * BATCH : (step + 1) * BATCH])))
        optimiser.zero_grad()
        value.backward()
        torch.nn.utils.clip_grad_norm_(head.parameters(), MOST_GRADIENT)
        optimiser.step()
        mean = value.item() if mean is None else 0.98 * mean + 0.02 * value.item()
        is_last = step + 1 == steps
        if (step + 1) % options.every == 0 or is_last:
            learned_by = {"head": head.state_dict(), "optimiser": optimiser.state_dict()}
            torch.save({"run": run, "step": step + 1, "loss": mean, **learned_by}, state.with_suffix(".new"))
            state.with_suffix(".new").replace(state)
            is_told = (step + 1) % (CHECK_LINES * options.every) == 0 or is_last
            note = f", {told(head, pairs, marked)}" if is_told else ""
            print(f"step {step + 1}, {time.monotonic() - begun:.0f} s, loss {mean:.3f}{note}", flush=True)
    head.eval()
    model = export(head, options.out)
    logits, pixels = check(head, model, pairs.batch(learned[:1]))
    size = options.out.stat().st_size
    print(f"{options.out}: {size} bytes, answers within {logits:.1e} and {pixels:.1e} px of those in training")


def pairs(options):
    from pairs import Teacher, Trunk, make, pictures

    options.out.mkdir(parents=True, exist_ok=True)
    stills = pictures(options.pictures)
    make(options.out, options.count, options.seed, Trunk(LITE0), Teacher(*options.teacher), options.video, stills)


def follow(options):
    from follow import follow
    from pairs import Trunk

    follow(Trunk(LITE0), options.head, options.video, options.sequences, options.out)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    folder, names = pathlib.Path, lambda text: text.split(",")
    made = commands.add_parser("pairs", help="make pairs")
    made.add_argument("out", type=folder)
    made.add_argument("--video", type=folder, nargs="*", default=[], help="folders of recordings")
    made.add_argument("--pictures", type=folder, nargs="*", default=[], help="folders of pictures")
    made.add_argument("--teacher", type=folder, nargs=2, required=True, metavar=("BACKBONE", "HEAD"))
    made.add_argument("--count", type=int, default=28000)
    made.add_argument("--seed", type=int, default=0)
    trained = commands.add_parser("train", help="train a head on pairs")
    trained.add_argument("out", type=folder, help="the ONNX file")
    trained.add_argument("--pairs", type=folder, nargs="+", required=True)
    trained.add_argument("--epochs", type=float, default=5)
    trained.add_argument("--seed", type=int, default=0)
    trained.add_argument("--threads", type=int, default=1)
    trained.add_argument("--every", type=int, default=200, help="steps from one log line and kept state to the next")
    trained.add_argument("--share", type=float, default=1, help="share of the pairs to learn, for a learning curve")
    trained.add_argument("--without", type=names, default=[], help="recordings to leave out, separated by commas")
    trained.add_argument("--check", type=names, default=[], help="recordings to check on, which are left out as well")
    alone = commands.add_parser("follow", help="follow targets with a head alone, for `evaluate --peer`")
    alone.add_argument("head", type=folder, help="the ONNX file")
    alone.add_argument("out", type=folder, help="a folder for the boxes")
    alone.add_argument("--video", type=folder, nargs="+", required=True, help="folders of recordings")
    alone.add_argument("--sequences", type=names, default=[], help="these recordings alone, separated by commas")
    options = parser.parse_args()
    {"pairs": pairs, "train": train, "follow": follow}[options.command](options)


if __name__ == "__main__":
    main()
