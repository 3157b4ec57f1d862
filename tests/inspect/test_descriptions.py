"""What `info` says about a network file."""

import dataclasses

import numpy as np
import pytest

from swarm_forage_env.inspect.descriptions import describe
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.policies.network import Network, NetworkAbout

FRAMED = InterfaceConfig(
    observation="compact", actions="discrete", automatic_gripper=True, decision_ticks=5, frame_decisions=200
)


@pytest.fixture
def told(tmp_path):
    """Write a network with a card, and return the lines about it."""

    def tell(**about) -> list[str]:
        layers = (np.zeros((23, 4), np.float32), np.zeros((4, 6), np.float32))
        biases = (np.zeros(4, np.float32), np.zeros(6, np.float32))
        Network(layers, biases, NetworkAbout(interface=FRAMED, samples=False, **{"activation": "tanh"} | about)).save(
            tmp_path / "mine.npz"
        )
        return list(describe(str(tmp_path / "mine.npz")).notes)

    return tell


def test_the_layers_and_every_field_of_the_interface_are_told(told):
    first, *lines = told(activation="relu", caches="static")
    assert first.endswith("mine.npz: a network of 23 x 4 x 6 units (relu)")
    fields = {line.split()[0]: line.split()[-1] for line in lines if line.startswith("    ")}
    assert {*(item.name for item in dataclasses.fields(InterfaceConfig)), "samples", "caches"} == set(fields)
    assert (fields["decision_ticks"], fields["frame_decisions"], fields["caches"]) == ("5", "200", "static")


def test_a_card_may_hold_anything_and_long_entries_are_cut(told):
    lines = told(card={"plan": {"stages": [{"steps": 7}] * 99, "hidden": [64, 32]}, "was": "me"})
    assert ["hidden", "64", "x", "32"] in [line.split() for line in lines]
    (stages,) = (line for line in lines if line.split()[:1] == ["stages"])
    assert stages.endswith(" ...")
    assert len(stages) < 200
    assert lines[-1].strip() == "me"
