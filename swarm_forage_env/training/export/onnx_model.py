"""A network as an ONNX model, with the words of its manual as metadata."""

from typing import Any

import numpy as np

from swarm_forage_env._internal.wording import install_command
from swarm_forage_env.policies.network import Network
from swarm_forage_env.training.export.manual import Manual

_OPSET, _IR_VERSION = 13, 8
"""Old ones, which runtimes of 2021 read; no operator needs newer ones."""


def onnx_model(network: Network, manual: Manual) -> bytes:
    """Return the model: inputs (robots, d) to "logits", or to "commands" in [-1, 1], (robots, m), all float32.

    Raises:
        ImportError: the package onnx is missing.
    """
    try:
        from onnx import TensorProto, checker, helper, numpy_helper
    except ImportError as error:
        raise ImportError(f"An ONNX file needs onnx: {install_command('export')}.") from error
    output = "logits" if manual.is_discrete else "commands"
    nodes: list[Any] = []
    constants: list[Any] = []
    last, value = len(network.weights) - 1, "inputs"
    for k, (weight, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        for name, array in ((f"weights_{k}", weight), (f"biases_{k}", bias)):
            constants.append(numpy_helper.from_array(np.ascontiguousarray(array, np.float32), name))
        summed = output if k == last and manual.is_discrete else f"sums_{k}"
        nodes.append(helper.make_node("Gemm", [value, f"weights_{k}", f"biases_{k}"], [summed]))
        value = summed
        if k < last:
            value = f"layer_{k}"
            nodes.append(helper.make_node(network.about.activation.capitalize(), [summed], [value]))
    if not manual.is_discrete:
        constants += [
            numpy_helper.from_array(np.array(end, np.float32), name) for end, name in ((-1, "least"), (1, "most"))
        ]
        nodes.append(helper.make_node("Clip", [value, "least", "most"], [output]))
    shapes = {"inputs": manual.n_inputs, output: manual.n_outputs}
    taken, returned = (
        helper.make_tensor_value_info(name, TensorProto.FLOAT, ["robots", size]) for name, size in shapes.items()
    )
    graph = helper.make_graph(nodes, manual.identifier, [taken], [returned], constants)
    model = helper.make_model(
        graph,
        producer_name="swarm_forage_env",
        opset_imports=[helper.make_opsetid("", _OPSET)],
        ir_version=_IR_VERSION,
        doc_string="\n".join(manual.lines),
    )
    helper.set_model_props(model, {"about": network.about.to_json()})
    checker.check_model(model)
    return model.SerializeToString()
