"""What users see of the options of environments: all of them, with types and meaning, whatever takes them."""

import inspect

import pytest

from swarm_forage_env.views.gymnasium import JointForageEnv, SwarmVectorEnv
from swarm_forage_env.views.pettingzoo import ParallelLearnerEnv, env, parallel_env
from swarm_forage_env.views.plans import plan_arena, takes
from swarm_forage_env.views.processes import open_arenas

ENVIRONMENTS = [
    (parallel_env, plan_arena),
    (env, plan_arena),
    (ParallelLearnerEnv, plan_arena),
    (JointForageEnv, plan_arena),
    (SwarmVectorEnv, open_arenas),
]


@pytest.mark.parametrize(("taking", "make"), ENVIRONMENTS, ids=lambda value: value.__name__)
def test_every_option_is_seen(taking, make):
    seen = inspect.signature(taking).parameters
    assert list(seen.values()) == list(inspect.signature(make).parameters.values())
    text = inspect.getdoc(taking.__init__ if isinstance(taking, type) else taking)
    assert all(f"\n    {name}: " in text for name in seen)
    assert "Raises:\n    ConfigError: " in text


def test_vector_environments_take_what_the_others_take():
    one, many = (inspect.signature(make).parameters for make in (plan_arena, open_arenas))
    assert set(many) - set(one) == {"num_envs", "n_arenas", "n_processes"}
    assert all(many[name] == parameter for name, parameter in one.items())


def test_without_docstrings_nothing_is_said():
    """As under `python -OO`."""

    def make(size: int = 3) -> int:
        return size

    @takes(make)
    def taking(*args, **options) -> str:
        return str(make(*args, **options))

    assert taking.__doc__ is None
    assert str(inspect.signature(taking)) == "(size: int = 3) -> str"
    assert taking(4) == "4"
