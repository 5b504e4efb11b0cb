"""Reads the tensors of a PyTorch weight file without PyTorch."""

import collections
import pickle
import struct
import zipfile

import numpy as np

TYPES = {
    "DoubleStorage": np.float64,
    "FloatStorage": np.float32,
    "HalfStorage": np.float16,
    "LongStorage": np.int64,
    "IntStorage": np.int32,
}


class Storage:
    """The values that tensors are views of; in the older format they follow after the tensors."""

    def __init__(self, kind):
        self.kind = np.dtype(TYPES[kind])
        self.values = None


def tensor(storage, offset, shape, strides, *_):
    def read():
        steps = [storage.kind.itemsize * stride for stride in strides]
        return np.lib.stride_tricks.as_strided(storage.values[offset:], shape, steps).copy()

    return read


class Unpickler(pickle.Unpickler):
    """Knows tensors and plain containers, and nothing that could run code."""

    def __init__(self, file, storages):
        super().__init__(file)
        self.storages = storages

    def find_class(self, module, name):
        if (module, name) == ("collections", "OrderedDict"):
            return collections.OrderedDict
        if (module, name) == ("torch._utils", "_rebuild_tensor_v2"):
            return tensor
        if (module, name) == ("torch._utils", "_rebuild_parameter"):
            return lambda data, *_: data
        if module == "torch" and name in TYPES:
            return name
        raise pickle.UnpicklingError(f"{module}.{name} is no part of a weight file")

    def persistent_load(self, saved):
        _, kind, key = saved[:3]
        return self.storages.setdefault(key, Storage(kind))


def read_weights(path):
    """The arrays of the state dictionary in `path`, by name."""
    storages = {}
    if zipfile.is_zipfile(path):  # since PyTorch 1.6
        with zipfile.ZipFile(path) as archive:
            (index,) = [name for name in archive.namelist() if name.endswith("data.pkl")]
            with archive.open(index) as file:
                tensors = Unpickler(file, storages).load()
            for key, storage in storages.items():
                data = archive.read(index.removesuffix("data.pkl") + f"data/{key}")
                storage.values = np.frombuffer(data, storage.kind)
    else:
        with open(path, "rb") as file:
            for _ in range(3):  # magic number, protocol, system
                Unpickler(file, storages).load()
            tensors = Unpickler(file, storages).load()
            for key in Unpickler(file, storages).load():
                (count,) = struct.unpack("<q", file.read(8))
                kind = storages[key].kind
                storages[key].values = np.frombuffer(file.read(count * kind.itemsize), kind)
    return {name: read() for name, read in tensors.items()}
