"""Made panels: scores of runs around given curves."""

import numpy as np

from metrics import Panel

N_RUNS = 16
SIX = np.arange(1.0, 7.0)


def panel(curves, *, levels=SIX, sd=0.01, n_runs=N_RUNS, seed=1):
    """Scores around curves, name -> height at each level (a number: the same everywhere); sd may be one per name."""
    rng = np.random.default_rng(seed)
    sds = sd if isinstance(sd, dict) else dict.fromkeys(curves, sd)
    levels = np.asarray(levels, dtype=float)
    noise = {name: sds[name] * rng.standard_normal((levels.size, n_runs)) for name in curves}
    return Panel(
        levels=levels, scores={k: np.broadcast_to(v, levels.shape)[:, None] + noise[k] for k, v in curves.items()}
    )
