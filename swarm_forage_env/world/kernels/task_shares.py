"""How a swarm divides over tasks, summed tick by tick."""

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.types import BoolArray, CodeArray, FloatArray


@kernel
def add_task_shares(tasks: CodeArray, active: BoolArray, shares: FloatArray) -> bool:
    """Add this tick's share of active robots in each task; nothing is added while no robot is active.

    Args:
        tasks: (N,) task codes.
        active: (N,) robots that count.
        shares: (codes,) sums, changed in place.

    Returns:
        Whether `tasks` had one code per robot, all of them within `shares`; if not, nothing was added.
    """
    if tasks.size != active.size:
        return False
    n_active = 0
    for i in range(active.size):
        if active[i]:
            n_active += 1
            if tasks[i] < 0 or tasks[i] >= shares.size:
                return False
    if n_active == 0:
        return True
    share = 1.0 / n_active
    for i in range(active.size):
        if active[i]:
            shares[tasks[i]] += share
    return True
