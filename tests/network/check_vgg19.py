"""Checks export_vgg19.py: seeded weights, stored as torchvision and as Keras store theirs, and exported, must give what a
forward pass in numpy gives."""

import collections
import io
import pathlib
import pickle
import sys
import tempfile
import types
import zipfile

import h5py
import numpy as np
import onnxruntime

sys.path.insert(0, str(pathlib.Path(__file__).parents[2] / "assets"))
import export_vgg19 as vgg

TOLERANCE = 1e-5
SIDE = 32


def forward(image, weights):
    outputs = {}
    for name, block, place, _, _ in vgg.layers():
        if place == 1 and block > 1:
            channels, rows, columns = image.shape
            image = image.reshape(channels, rows // 2, 2, columns // 2, 2).max((2, 4))
        kernel, bias = weights[name]
        padded = np.pad(image, ((0, 0), (1, 1), (1, 1)))
        views = np.lib.stride_tricks.sliding_window_view(padded, (3, 3), axis=(1, 2))
        image = np.maximum(np.einsum("irckl,oikl->orc", views, kernel, optimize=True) + bias[:, None, None], 0)
        outputs[name] = image
    return outputs


def write_keras(path, weights):
    with h5py.File(path, "w") as file:
        for name, block, place, _, _ in vgg.layers():
            layer = f"block{block}_conv{place}"
            group = file.create_group(f"{layer}/{layer}")
            group["kernel:0"], group["bias:0"] = weights[name][0].transpose(2, 3, 1, 0), weights[name][1]


def write_torchvision(path, weights):
    """A file as PyTorch writes it, with stand-ins for the few names of PyTorch's that it mentions."""

    def named(module, name):
        stand_in = type(name, (), {"__module__": module})
        sys.modules.setdefault(module, types.ModuleType(module))
        setattr(sys.modules[module], name, stand_in)
        return stand_in

    storage_type, rebuild = named("torch", "FloatStorage"), named("torch._utils", "_rebuild_tensor_v2")

    class Storage:
        def __init__(self, key, count):
            self.saved = ("storage", storage_type, key, "cpu", count)

    class Tensor:
        def __init__(self, key, array):
            strides = tuple(s // array.itemsize for s in array.strides)
            self.parts = (Storage(key, array.size), 0, array.shape, strides, False, collections.OrderedDict())

        def __reduce__(self):
            return rebuild, self.parts

    class Pickler(pickle.Pickler):
        def persistent_id(self, item):
            return item.saved if isinstance(item, Storage) else None

    # Where torchvision's sequence of layers has its convolutions.
    places = [0, 2, 5, 7, 10, 12, 14, 16, 19, 21, 23, 25, 28, 30, 32, 34]
    tensors, arrays = collections.OrderedDict(), {}
    for place, (kernel, bias) in zip(places, weights.values()):
        for part, array in (("weight", kernel), ("bias", bias)):
            key = str(len(arrays))
            arrays[key] = np.ascontiguousarray(array)
            tensors[f"features.{place}.{part}"] = Tensor(key, arrays[key])
    index = io.BytesIO()
    Pickler(index, 2).dump(tensors)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("vgg19/data.pkl", index.getvalue())
        for key, array in arrays.items():
            archive.writestr(f"vgg19/data/{key}", array.tobytes())


def main():
    weights, _, _ = vgg.seeded(3)
    rng = np.random.default_rng(0)
    weights = {
        name: (kernel, rng.uniform(-0.1, 0.1, len(bias)).astype(np.float32)) for name, (kernel, bias) in weights.items()
    }
    rgb = rng.uniform(0, 255, (3, SIDE, SIDE)).astype(np.float32)
    mean, scale = np.array([0.485, 0.456, 0.406]), np.array([0.229, 0.224, 0.225])
    as_torchvision = (rgb / 255 - mean[:, None, None]) / scale[:, None, None]
    as_keras = rgb[::-1] - np.array([103.939, 116.779, 123.68])[:, None, None]
    with tempfile.TemporaryDirectory() as folder:
        for name, write, image in (
            ("weights.pth", write_torchvision, as_torchvision),
            ("weights.h5", write_keras, as_keras),
        ):
            path, exported = pathlib.Path(folder) / name, pathlib.Path(folder) / "vgg19.onnx"
            write(path, weights)
            sys.argv = ["export_vgg19.py", str(path), str(exported)]
            vgg.main()
            wanted = forward(image, weights)
            outputs = onnxruntime.InferenceSession(str(exported)).run(vgg.OUTPUTS, {"image": rgb[None]})
            for output, got in zip(vgg.OUTPUTS, outputs):
                error = np.abs(got[0] - wanted[output]).max() / np.abs(wanted[output]).max()
                print(f"{name} {output} {got.shape} relative error {error:.1e}")
                assert error < TOLERANCE


if __name__ == "__main__":
    main()
