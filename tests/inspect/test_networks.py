"""What `info` says about a network file."""

import re
from pathlib import Path

import numpy as np
import pytest

from swarm_forage_env.inspect.networks import network_lines
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.policies.network import Network, NetworkAbout

FRAMED = InterfaceConfig(observation="compact", actions="discrete", decision_ticks=5, frame_decisions=200)
SAMPLED = {
    "sampler": {
        "worlds": [
            {"scenario": {"preset": "warehouse_small", "n_robots": {"uniform": [8, 32]}}, "weight": 1.0},
            {"scenario": {"preset": {"name": "mine"}, "width_m": 40.0, "nest_size_m": [4.0, 6.4]}, "weight": 1.0},
        ],
        "scenario": {"horizon_s": {"choice": [1000.0, 4000.0]}},
        "wrappers": {"throttle": {}},
    },
    "stages": [{"steps": 300, "scenario": {}, "sampler": {}}, {"steps": 4000, "scenario": {}}],
}


def told(about: NetworkAbout) -> str:
    network = Network((np.zeros((3, 4), np.float32), np.zeros((4, 2), np.float32)), (np.zeros(4), np.zeros(2)), about)
    return "\n".join(network_lines(Path("mine.npz"), network))


def section(text: str, title: str) -> list[tuple[str, ...]]:
    """Return names and values of a section of a card."""
    (lines,) = re.findall(rf"^  \[{title}\]\n((?:    .*\n?)*)", text, re.MULTILINE)
    return [tuple(re.split(r"\s{2,}", line.strip(), maxsplit=1)) for line in lines.splitlines()]


def test_every_field_of_the_interface_and_the_layers_are_told():
    text = told(NetworkAbout(interface=FRAMED, activation="relu"))
    assert text.startswith("mine.npz: a network of 3 x 4 x 2 units (relu)\n")
    fields = dict(line.split(maxsplit=1) for line in text.splitlines()[2:])
    assert set(InterfaceConfig.__dataclass_fields__) <= set(fields)
    assert (fields["decision_ticks"], fields["frame_decisions"], fields["neighbours_seen"]) == ("5", "200", "none")


def test_it_tells_the_worlds_that_a_sampler_drew():
    text = told(NetworkAbout(interface=FRAMED, card={"plan": SAMPLED}))
    assert section(text, "trained in") == [
        ("warehouse_small", "n_robots 8 to 32"),
        ("mine", "width_m 40.0, nest_size_m 4 x 6.4"),
        ("all of them", "horizon_s 1000.0 or 4000.0"),
        ("wrappers", "throttle"),
        ("stage 1", "300 decisions, in worlds of its own"),
        ("stage 2", "4000 decisions"),
    ]


@pytest.mark.parametrize(
    "plan",
    ["a text", {}, {"sampler": 3}, {"sampler": {"worlds": [4]}, "stages": {}}, {"scenario": [], "stages": [None]}],
)
def test_a_card_may_hold_anything(plan):
    assert told(NetworkAbout(interface=FRAMED, card={"plan": plan, "by": "me"})).endswith("\n  [by]\n    me")
