"""What robots of several kinds observe of themselves, and what they cannot observe."""

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.types import BoolArray, IntArray, ObsArray


@kernel
def tell_kinds(kinds: ObsArray, present: BoolArray, obs: ObsArray, start: int) -> None:
    """Write the columns (N, C) of each robot's kind into `obs` (N, D) from column `start`; (0, C) writes nothing."""
    for i in range(kinds.shape[0]):
        for k in range(kinds.shape[1]):
            obs[i, start + k] = kinds[i, k] if present[i] else 0.0


@kernel
def blank(obs: ObsArray, blanks: IntArray) -> None:
    """Write zero where robots lack a sensor.

    Args:
        obs: (N, D), edited.
        blanks: (B, 4) first row, row behind the last, first column, column behind the last.
    """
    for b in range(blanks.shape[0]):
        obs[blanks[b, 0] : blanks[b, 1], blanks[b, 2] : blanks[b, 3]] = 0.0
