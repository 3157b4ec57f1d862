"""Measures of swarm behaviour after Harwell and Gini: arrays in, numbers out.

Every measure is a function of curves, arrays of shape (..., T) over recording intervals; it knows nothing of robots,
files or policies. `docs/metrics.md` explains inputs and variants, `docs/errata.md` the errors in the paper.
`score` runs policies in all experiments that the measures need, and says which is better at what (`docs/scoring.md`).

Public names stand in `__init__.pyi`. They load on first use, so importing the package compiles nothing. No public name
equals the name of a module: a module that loads later would replace it.
"""

from typing import Any

import lazy_loader  # pyright: ignore[reportMissingTypeStubs] - it ships none

_attach: Any = lazy_loader.attach_stub
__getattr__, __dir__, __all__ = _attach(__name__, __file__)
