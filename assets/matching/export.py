"""Writes a trained head as an ONNX file. Batch norms are folded into the convolutions, and weights stored in two 8-bit
digits, as in make_lite0.py."""

import numpy as np
import onnx
import torch
from onnx import TensorProto, helper, numpy_helper

from head import CHANNELS, TEMPLATE_CELLS, UNIT, WINDOW_CELLS
from pairs import CELLS

OPSET = 13
IR_VERSION = 7
# What is added to the logits. On video that a head has not seen its scores are lower than its teacher's, for which the
# tracker's constants are made.
LIFT = 4.0
INPUTS = {
    "template_deep": (112, TEMPLATE_CELLS),
    "template_fine": (40, 2 * TEMPLATE_CELLS),
    "window_deep": (112, WINDOW_CELLS),
    "window_fine": (40, 2 * WINDOW_CELLS),
}


class Graph:
    def __init__(self):
        self.nodes, self.constants, self.weights = [], [], {}

    def constant(self, name, array):
        self.constants.append(numpy_helper.from_array(np.ascontiguousarray(array), name))
        return name

    def integers(self, name, values):
        return self.constant(name, np.array(values, np.int64))

    def node(self, kind, inputs, name, **attributes):
        self.nodes.append(helper.make_node(kind, inputs, [name], **attributes))
        return name

    def compact(self, name, array):
        """The sum of two digits: 8-bit integers with a scale, and what they leave over in the same way."""
        if name in self.weights:
            return self.weights[name]
        scale = np.abs(array).max(axis=(1, 2, 3), keepdims=True) / 127
        scale = np.maximum(scale, np.finfo(np.float32).tiny).astype(np.float32)
        high = np.rint(array / scale)
        low = np.rint((array / scale - high) * 254)
        digits = []
        for digit, integers, unit in (("high", high, scale), ("low", low, scale / np.float32(254))):
            cast = self.node(
                "Cast",
                [self.constant(f"{name}/{digit}", integers.clip(-127, 127).astype(np.int8))],
                f"{name}/{digit}/cast",
                to=TensorProto.FLOAT,
            )
            scaled = [cast, self.constant(f"{name}/{digit}/unit", unit.astype(np.float32))]
            digits.append(self.node("Mul", scaled, f"{name}/{digit}/float"))
        self.weights[name] = self.node("Add", digits, f"{name}/weights")
        return self.weights[name]

    def convolution(self, x, weights, bias, name, shared=None, stride=1, activated=False):
        side = weights.shape[2]
        padding = side // 2 if stride == 1 else 0
        inputs = [x, self.compact(shared or name, weights)]
        if bias is not None:
            inputs.append(self.constant(f"{name}/bias", bias.astype(np.float32)))
        result = self.node(
            "Conv",
            inputs,
            f"{name}/sum" if activated else name,
            kernel_shape=[side, side],
            strides=[stride, stride],
            pads=[padding] * 4,
        )
        return self.node("Relu", [result], name) if activated else result

    def cut(self, x, first, end, name):
        bounds = [self.integers(f"{name}/{what}", [at, at]) for what, at in (("first", first), ("end", end))]
        return self.node("Slice", [x, *bounds, self.integers(f"{name}/axes", [2, 3])], name)


def export(head, path):
    state = {name: value.numpy().astype(np.float64) for name, value in head.state_dict().items()}
    graph = Graph()

    def norm(name):
        gain = state[f"{name}.weight"] / np.sqrt(state[f"{name}.running_var"] + 1e-5)
        return gain, state[f"{name}.bias"] - state[f"{name}.running_mean"] * gain

    def folded(name):
        gain, bias = norm(f"{name}.1")
        return state[f"{name}.0.weight"] * gain[:, None, None, None], bias

    def adapted(which):
        gain, bias = norm("adapter.norm")
        parts = [
            graph.convolution(
                f"{which}_{part}",
                state[f"adapter.{part}.weight"] * gain[:, None, None, None],
                bias if part == "deep" else None,
                f"{which}/{part}",
                shared=f"adapter/{part}",
                stride=stride,
            )
            for part, stride in (("deep", 1), ("fine", 2))
        ]
        return graph.node("Add", parts, which)

    def layer(x, name):
        return graph.convolution(x, *folded(name), name, activated=True)

    def last(x, name, lift=0.0):
        x = layer(x, f"{name}.0")
        x = graph.convolution(x, state[f"{name}.1.weight"], state[f"{name}.1.bias"] + lift, f"{name}.1")
        return graph.cut(x, 0, CELLS, f"{name}/cut")

    def reshaped(x, shape, name):
        return graph.node("Reshape", [x, graph.integers(f"{name}/shape", shape)], name)

    template, window = adapted("template"), adapted("window")
    cells = TEMPLATE_CELLS**2
    columns = graph.node("Transpose", [reshaped(template, [CHANNELS, cells], "template/flat")], "columns", perm=[1, 0])
    product = graph.node("MatMul", [columns, reshaped(window, [CHANNELS, WINDOW_CELLS**2], "window/flat")], "product")
    product = reshaped(product, [1, cells, WINDOW_CELLS, WINDOW_CELLS], "product/map")
    gain, bias = (values.reshape(1, -1, 1, 1).astype(np.float32) for values in norm("alike"))
    scaled = graph.node("Mul", [product, graph.constant("alike/gain", gain / np.float32(CHANNELS))], "alike/scaled")
    alike = graph.node("Add", [scaled, graph.constant("alike/bias", bias)], "alike")
    middle = graph.cut(template, 1, TEMPLATE_CELLS - 1, "middle")
    mean = graph.node("ReduceMean", [middle], "mean", axes=[2, 3], keepdims=1)
    weights = state["gate.weight"][:, :, None, None]
    gate = graph.node("Sigmoid", [graph.convolution(mean, weights, state["gate.bias"], "gate/sum")], "gate")
    gated = graph.node("Mul", [window, gate], "gated")
    features = layer(graph.node("Concat", [alike, gated, window], "all", axis=1), "fuse")
    for index in range(3):
        features = graph.node("Add", [features, layer(features, f"tower.{index}")], f"features{index}")
    score, sides = last(features, "score", LIFT), last(features, "sides")
    nothing = graph.node("Mul", [score, graph.constant("zero", np.float32(0))], "nothing")
    graph.node("Concat", [nothing, score], "logits", axis=1)
    bounds = [graph.constant(name, np.float32(value)) for name, value in (("least", -6), ("most", 3))]
    lengths = graph.node("Exp", [graph.node("Clip", [sides, *bounds], "bounded")], "lengths")
    graph.node("Mul", [lengths, graph.constant("unit", np.float32(UNIT))], "distances")

    def tensor(name, channels, side):
        return helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, channels, side, side])

    inputs = [tensor(name, *shape) for name, shape in INPUTS.items()]
    outputs = [tensor("logits", 2, CELLS), tensor("distances", 4, CELLS)]
    made = helper.make_graph(graph.nodes, "matching head", inputs, outputs, graph.constants)
    model = helper.make_model(made, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
    model.producer_name = "train_matching.py"
    onnx.checker.check_model(model, full_check=True)
    onnx.save(model, str(path))
    return model


def check(head, model, pairs):
    """How far the file's answers are from the trained head's: logits, and pixels."""
    import onnxruntime

    inputs = [pairs[name][:1] for name in INPUTS]
    with torch.no_grad():
        expected = head(*inputs)
    feed = {name: values.numpy() for name, values in zip(INPUTS, inputs)}
    logits, sides = onnxruntime.InferenceSession(model.SerializeToString()).run(None, feed)
    found = torch.from_numpy(logits[:, 1]) - LIFT, torch.from_numpy(sides)
    return [float((a - b).abs().max()) for a, b in zip(expected, found)]
