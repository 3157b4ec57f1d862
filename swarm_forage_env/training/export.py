"""A trained network as a file for robots and other simulators: ONNX, or a C header that needs nothing else."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.files import replacing
from swarm_forage_env._internal.wording import install_command, suggestion
from swarm_forage_env.policies.network import Network
from swarm_forage_env.policies.pretrained import network_file, network_names
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.presets import chosen_scenario
from swarm_forage_env.training.c_header import c_header, identifier_of
from swarm_forage_env.training.manual import manual_of

ENDINGS = {".h": "a C header", ".onnx": "ONNX"}
_OPSET, _IR_VERSION = 13, 8
"""Of ONNX: old ones, which runtimes of 2021 read; no operator needs newer ones."""


def export_policy(policy: str | Path, file: str | Path, scenario: str | ScenarioConfig = "warehouse_small") -> Path:
    """Write the network of a policy as a C header or as ONNX; the ending of the file says which.

        export_policy("generalist", "generalist.h")

    Both hold the layers, and say in words what goes in and what comes out.

    Args:
        policy: Name of a shipped network, or path of an .npz file.
        file: To write, .h or .onnx; an existing one is replaced.
        scenario: World in which the network is used. The words say how large it is, since positions are shares of
            the arena. It must have what the network sees: neighbours, messages.

    Returns:
        The path of the file.

    Raises:
        ConfigError: another ending, a policy that is no network, or a scenario without what it sees.
        NetworkError: a file that holds no network, or one that does not fit its interface.
        ImportError: the package onnx is missing, for ONNX.
        OSError: a file cannot be read or written.
    """
    target = Path(file)
    if target.suffix not in ENDINGS:
        expected = " or ".join(f"{ending} ({what})" for ending, what in ENDINGS.items())
        raise ConfigError(f"Expected a file that ends in {expected}, got {target}.")
    network = _network_of(str(policy))
    name, manual = Path(policy).stem, manual_of(network, chosen_scenario(scenario, {}))
    is_header = target.suffix == ".h"
    content = c_header(network, name, manual).encode() if is_header else _onnx_model(network, name, manual)
    with replacing(target) as draft:
        draft.write_bytes(content)
    return target


def _network_of(policy: str) -> Network:
    """Return the network of a shipped policy, or of a file."""
    file = network_file(policy) or Path(policy)
    if file.suffix.lower() != ".npz":
        known = network_names()
        raise ConfigError(
            f"Expected a network, that is the name of a shipped one ({', '.join(known)}) or an .npz file, got "
            f"{policy!r}.{suggestion(policy, known)} Training leaves policy.npz beside a model; other policies have no "
            "network to export."
        )
    return Network.load(file)


def _onnx_model(network: Network, name: str, manual: Iterable[str]) -> bytes:
    """Return a model: inputs (robots, d) to "logits", or to "commands" in [-1, 1], (robots, m), all float32.

    Raises:
        ImportError: the package onnx is missing.
    """
    try:
        from onnx import TensorProto, checker, helper, numpy_helper
    except ImportError as error:
        raise ImportError(f"An ONNX file needs onnx: {install_command('export')}.") from error
    is_discrete = network.about.interface.actions == "discrete"
    output = "logits" if is_discrete else "commands"
    nodes: list[Any] = []
    constants: list[Any] = []
    last, value = len(network.weights) - 1, "inputs"
    for k, (weight, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        for what, array in ((f"weights_{k}", weight), (f"biases_{k}", bias)):
            constants.append(numpy_helper.from_array(np.ascontiguousarray(array, np.float32), what))
        summed = output if k == last and is_discrete else f"sums_{k}"
        nodes.append(helper.make_node("Gemm", [value, f"weights_{k}", f"biases_{k}"], [summed]))
        value = summed
        if k < last:
            value = f"layer_{k}"
            nodes.append(helper.make_node(network.about.activation.capitalize(), [summed], [value]))
    if not is_discrete:
        constants += [
            numpy_helper.from_array(np.array(end, np.float32), what) for end, what in ((-1, "least"), (1, "most"))
        ]
        nodes.append(helper.make_node("Clip", [value, "least", "most"], [output]))
    shapes = {"inputs": network.n_columns, output: len(network.biases[-1])}
    taken, returned = (
        helper.make_tensor_value_info(what, TensorProto.FLOAT, ["robots", size]) for what, size in shapes.items()
    )
    graph = helper.make_graph(nodes, identifier_of(name), [taken], [returned], constants)
    model = helper.make_model(
        graph,
        producer_name="swarm_forage_env",
        opset_imports=[helper.make_opsetid("", _OPSET)],
        ir_version=_IR_VERSION,
        doc_string="\n".join(manual),
    )
    helper.set_model_props(model, {"about": network.about.to_json()})
    checker.check_model(model)
    return model.SerializeToString()
