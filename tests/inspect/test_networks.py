"""What `info` says about a network file."""

import re
from pathlib import Path

import numpy as np
import pytest

from swarm_forage_env.inspect.networks import in_words, network_lines
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
    "turned": True,
    "stages": [{"steps": 300, "scenario": {}, "sampler": {}}, {"steps": 4000, "scenario": {}}],
}
ONE_WORLD = {
    "scenario": {"name": "warehouse_medium", "robots": {"n_robots": 50}},
    "wrappers": {},
    "stages": [{"steps": 20, "scenario": {"horizon_s": 600.0}}],
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


@pytest.mark.parametrize(
    ("interface", "samples", "words"),
    [
        (FRAMED, True, "True (draws actions by their probabilities)"),
        (FRAMED, False, "False (greedy: takes the likeliest action)"),
        (InterfaceConfig(), True, "True (takes the mean)"),
    ],
)
def test_it_tells_how_actions_are_chosen(interface, samples, words):
    assert f"\n  samples             {words}\n" in told(NetworkAbout(interface=interface, samples=samples))


def test_it_tells_the_worlds_that_a_sampler_drew():
    text = told(NetworkAbout(interface=FRAMED, card={"plan": SAMPLED}))
    assert section(text, "trained in") == [
        ("warehouse_small", "n_robots 8 to 32"),
        ("mine", "width_m 40.0, nest_size_m 4 x 6.4"),
        ("all of them", "horizon_s 1000.0 or 4000.0"),
        ("wrappers", "throttle"),
        ("turned", "True"),
        ("stage 1", "300 decisions, in worlds of its own"),
        ("stage 2", "4000 decisions"),
    ]


def test_it_tells_the_only_world():
    text = told(NetworkAbout(interface=FRAMED, card={"plan": ONE_WORLD}))
    assert section(text, "trained in") == [
        ("warehouse_medium", "n_robots 50"),
        ("wrappers", "none"),
        ("turned", "False"),
        ("stage 1", "20 decisions, horizon_s 600.0"),
    ]


def test_it_tells_how_a_network_learnt_to_decide_where_that_is_not_how_it_runs():
    in_runs = {"decision_ticks": 2, "frame_decisions": 200}
    plan = {**ONE_WORLD, "interface": {"decision_ticks": 5, "frame_decisions": 200}, "in_runs": in_runs}
    text = told(NetworkAbout(interface=FRAMED, card={"plan": plan}))
    assert ("learnt with", "decision_ticks 5") in section(text, "trained in")


def test_it_tells_a_temperature_of_the_plan():
    text = told(NetworkAbout(interface=FRAMED, card={"plan": {**ONE_WORLD, "temperature": 0.5}}))
    assert ("temperature", "0.5, in the weights of the last layer") in section(text, "trained in")


def test_a_list_of_tables_takes_a_line_for_each():
    worlds = [{"world": "one", "ratio": 1.23456789}, {"world": "two", "ratio": 2.0}]
    text = told(NetworkAbout(interface=FRAMED, card={"evaluation": {"steps": 5, "worlds": worlds}}))
    assert section(text, "evaluation") == [
        ("steps", "5"),
        ("worlds", "world one, ratio 1.23457"),
        ("world two, ratio 2",),
    ]


@pytest.mark.parametrize(
    "plan",
    ["a text", {}, {"sampler": 3}, {"sampler": {"worlds": [4]}, "stages": {}}, {"scenario": [], "stages": [None]}],
)
def test_a_card_may_hold_anything(plan):
    assert told(NetworkAbout(interface=FRAMED, card={"plan": plan, "by": "me"})).endswith("\n  [by]\n    me")


@pytest.mark.parametrize(
    ("value", "words"), [((4, 6.5), "4 x 6.5"), (("a", "b"), "a, b"), ({"uniform": 3}, "uniform 3"), (None, "None")]
)
def test_values_in_words(value, words):
    assert in_words(value) == words
