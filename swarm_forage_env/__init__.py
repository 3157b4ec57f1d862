"""Swarm foraging as a PettingZoo environment.

Public names stand in `__init__.pyi` and load on first use. Importing the package registers every scenario with
Gymnasium and PettingZoo, under ids such as `swarm_forage/warehouse_small-v0`.
"""

import signal
import sys
from pathlib import Path
from typing import Any

if {"swarm-forage", "swarm_forage_env.cli"} & {Path(word).name for word in sys.orig_argv} and (
    signal.getsignal(signal.SIGINT) is signal.default_int_handler
):
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C ends the command quietly until `cli.hear` hears it

import gymnasium
import lazy_loader

try:
    import pettingzoo
except FileNotFoundError:  # it asks for the working folder, before any command of ours could answer
    raise SystemExit("swarm-forage: The working folder is gone; go to one that is there (cd).") from None

from swarm_forage_env.scenarios import SCENARIO_NAMES as _SCENARIO_NAMES

_load, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version  # slow to import and rarely asked for

        return version("swarm-forage-env")
    return _load(name)


for _scenario in (*_SCENARIO_NAMES, "sampled"):
    _id, _kwargs = f"swarm_forage/{_scenario}-v0", {"scenario": _scenario}
    gymnasium.register(
        _id,
        "swarm_forage_env.views.gymnasium:JointForageEnv",
        kwargs=_kwargs,
        vector_entry_point="swarm_forage_env.views.gymnasium:vector_env",
    )
    if hasattr(pettingzoo, "register"):  # before 1.27 there are no ids
        pettingzoo.register("parallel", _id, "swarm_forage_env.views.pettingzoo:parallel_env", kwargs=_kwargs)
        pettingzoo.register("aec", _id, "swarm_forage_env.views.pettingzoo:env", kwargs=_kwargs)
