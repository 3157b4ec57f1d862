"""Whole runs are the same in both engines; a contact that is changed by a tenth in one of them is found."""

import importlib
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import KDTree

from swarm_forage_env.world import chipmunk

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"


@pytest.fixture
def check(monkeypatch):
    """The check of `scripts/compare_engines.py` in the case in which robots touch most; the others take time."""
    monkeypatch.syspath_prepend(str(SCRIPTS))
    script = importlib.import_module("compare_engines")
    monkeypatch.setattr(script, "CHECKED", [(script.CROWDED, "dpo", 60)])
    return lambda: script.main(["--check"])


def test_engines_that_are_alike_pass(check, capsys):
    assert check() == 0
    assert "1 of 1 cases have the same numbers" in capsys.readouterr().out


def test_another_friction_is_found(check, monkeypatch, capsys):
    monkeypatch.setattr(chipmunk, "FRICTION", 0.9 * chipmunk.FRICTION)
    assert check() == 1
    assert "The engines differ: in 1 cases" in capsys.readouterr().out


def test_another_speed_in_contact_is_found(check, monkeypatch):
    advance = chipmunk.ChipmunkBodies.advance

    def weaker(bodies, swarm):
        pairs = KDTree(swarm.position).query_pairs(0.172, output_type="ndarray")  # two radii and 2 mm
        bodies.twist[np.unique(pairs), :2] *= 0.9
        advance(bodies, swarm)

    monkeypatch.setattr(chipmunk.ChipmunkBodies, "advance", weaker)
    assert check() == 1
