"""export_policy: a trained network as a file for robots and other simulators."""

from pathlib import Path

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.files import replacing
from swarm_forage_env._internal.wording import suggestion
from swarm_forage_env.policies.network import Network
from swarm_forage_env.policies.pretrained import network_file, network_names
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.presets import chosen_scenario
from swarm_forage_env.training.export.c_header import c_header
from swarm_forage_env.training.export.manual import manual_of
from swarm_forage_env.training.export.onnx_model import onnx_model

ENDINGS = {".h": "a C header", ".onnx": "ONNX"}


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
    manual = manual_of(network, chosen_scenario(scenario, {}), Path(policy).stem)
    content = c_header(network, manual).encode() if target.suffix == ".h" else onnx_model(network, manual)
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
