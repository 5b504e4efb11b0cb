"""Exports VGG-19 up to conv5-4 to ONNX, for params/paper.yaml.

    python -m venv venv && venv/bin/pip install -r requirements.txt
    venv/bin/python export_vgg19.py WEIGHTS vgg19.onnx

WEIGHTS is a file of ImageNet weights, of either
  * torchvision: the state dictionary vgg19-dcbb9e9d.pth (or any of the same names), or
  * Keras: vgg19_weights_tf_dim_ordering_tf_kernels_notop.h5 (with or without the top). These are the weights of the
    network's authors, which the paper used.

Input: `image`, 1 x 3 x rows x columns, RGB intensities from 0 to 255. What the weights expect instead (BGR, a mean taken
off, a scale) is part of the exported network, so that both kinds are used with the same parameters.
Outputs: `conv4_4` and `conv5_4` after their rectifiers, 512 channels each at strides 8 and 16.

`--seed N` in place of WEIGHTS writes the same network with random weights: to try out memory, speed and wiring.
"""

import argparse
import pathlib

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

OPSET = 13
IR_VERSION = 7
# Convolutions of each block, and their output channels. All are 3 x 3 with a border of 1 and a rectifier behind.
BLOCKS = [(2, 64), (2, 128), (4, 256), (4, 512), (4, 512)]
OUTPUTS = ["conv4_4", "conv5_4"]
TORCHVISION_MEAN = 255 * np.array([0.485, 0.456, 0.406])
TORCHVISION_SCALE = 255 * np.array([0.229, 0.224, 0.225])
CAFFE_MEAN_BGR = np.array([103.939, 116.779, 123.68])


def layers():
    """Name, block, place in the block, input and output channels of each convolution."""
    inputs = 3
    for block, (count, channels) in enumerate(BLOCKS, 1):
        for place in range(1, count + 1):
            yield f"conv{block}_{place}", block, place, inputs, channels
            inputs = channels


def torchvision(path):
    from pytorch_weights import read_weights

    tensors = read_weights(path)
    index, weights = 0, {}
    for name, block, place, _, _ in layers():
        weights[name] = (tensors[f"features.{index}.weight"], tensors[f"features.{index}.bias"])
        index += 2 if place < BLOCKS[block - 1][0] else 3  # a rectifier, and a pooling at the block's end
    return weights, TORCHVISION_MEAN, TORCHVISION_SCALE


def keras(path):
    import h5py

    weights = {}
    with h5py.File(path) as file:
        root = file["model_weights"] if "model_weights" in file else file
        for name, block, place, _, _ in layers():
            arrays = []
            root[f"block{block}_conv{place}"].visititems(
                lambda _, item: arrays.append(item[()]) if isinstance(item, h5py.Dataset) else None
            )
            kernel = next(a for a in arrays if a.ndim == 4).transpose(3, 2, 0, 1)
            weights[name] = (kernel, next(a for a in arrays if a.ndim == 1))
    kernel, bias = weights["conv1_1"]
    weights["conv1_1"] = (kernel[:, ::-1], bias)  # from BGR to RGB
    return weights, CAFFE_MEAN_BGR[::-1], np.ones(3)


def seeded(seed):
    rng = np.random.default_rng(seed)
    weights = {}
    for name, _, _, inputs, outputs in layers():
        spread = np.sqrt(2 / (9 * inputs))
        kernel = rng.standard_normal((outputs, inputs, 3, 3), dtype=np.float32) * np.float32(spread)
        weights[name] = (kernel, np.zeros(outputs, np.float32))
    return weights, TORCHVISION_MEAN, TORCHVISION_SCALE


def build(weights, mean, scale):
    constants = []

    def constant(name, array):
        array = np.ascontiguousarray(array, np.float32)
        constants.append(numpy_helper.from_array(array, name))
        return name

    nodes = [
        helper.make_node("Sub", ["image", constant("mean", mean.reshape(1, 3, 1, 1))], ["centred"]),
        helper.make_node("Div", ["centred", constant("scale", scale.reshape(1, 3, 1, 1))], ["scaled"]),
    ]
    present = "scaled"
    for name, block, place, inputs, outputs in layers():
        if place == 1 and block > 1:
            nodes.append(
                helper.make_node("MaxPool", [present], [f"pool{block - 1}"], kernel_shape=[2, 2], strides=[2, 2])
            )
            present = f"pool{block - 1}"
        kernel, bias = weights[name]
        if kernel.shape != (outputs, inputs, 3, 3) or bias.shape != (outputs,):
            raise SystemExit(f"{name}: weights of shape {kernel.shape}, expected {(outputs, inputs, 3, 3)}")
        nodes.append(
            helper.make_node(
                "Conv",
                [present, constant(f"{name}/weights", kernel), constant(f"{name}/bias", bias)],
                [f"{name}/sum"],
                name=name,
                kernel_shape=[3, 3],
                pads=[1, 1, 1, 1],
            )
        )
        nodes.append(helper.make_node("Relu", [f"{name}/sum"], [name]))
        present = name
    shape = [1, 512, None, None]
    graph = helper.make_graph(
        nodes,
        "VGG-19 to conv5-4",
        [helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, 3, "rows", "columns"])],
        [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name in OUTPUTS],
        constants,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
    model.producer_name = "export_vgg19.py"
    onnx.checker.check_model(model, full_check=True)
    return model


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("weights", nargs="?", type=pathlib.Path)
    parser.add_argument("output", type=pathlib.Path)
    parser.add_argument("--seed", type=int)
    arguments = parser.parse_args()
    if (arguments.weights is None) == (arguments.seed is None):
        parser.error("give either WEIGHTS or --seed")
    if arguments.seed is not None:
        network = seeded(arguments.seed)
    elif arguments.weights.suffix in (".h5", ".hdf5"):
        network = keras(arguments.weights)
    else:
        network = torchvision(arguments.weights)
    model = build(*network)
    arguments.output.write_bytes(model.SerializeToString(deterministic=True))
    print(f"{arguments.output}: {arguments.output.stat().st_size} bytes")


if __name__ == "__main__":
    main()
