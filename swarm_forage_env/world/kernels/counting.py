"""What is counted in every tick: who is in interference, who is at work, and how the swarm divides over tasks."""

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.codes import Counter
from swarm_forage_env.contract.detection import sees_obstacle
from swarm_forage_env.contract.layout import RING_SENSORS
from swarm_forage_env.contract.types import BoolArray, CodeArray, FloatArray, ObsArray
from swarm_forage_env.world.state import StepEvents, SwarmState

_INTERFERING, _ACTIVE, _PRESENT = int(Counter.INTERFERING), int(Counter.ACTIVE), int(Counter.PRESENT)
_CARRYING = int(Counter.CARRYING)


@kernel
def mark(
    obs: ObsArray,
    proximity: int,
    near: BoolArray,
    behind_counts: bool,
    swarm: SwarmState,
    events: StepEvents,
) -> None:
    """Flag active robots for which the obstacle rule holds in this tick, walls and boxes included, and count the tick.

    The rule uses geometry only, so it is the same for every policy.

    Args:
        obs: (N, D) with true proximity readings.
        proximity: Column of the first of them.
        near: (N,) whether any beam may have hit something; others are skipped.
        behind_counts: Quirk `obstacle_behind_counts`.
        swarm: Read.
        events: `interfering` is written, `counters` are added to, and the share of active robots (0/0 = 0) is added to
            `interference_sum`.
    """
    active, counters = swarm.active, events.counters
    n_interfering = 0
    n_active = 0
    n_present = 0
    n_carrying = 0
    for i in range(active.shape[0]):
        ring = obs[i, proximity : proximity + RING_SENSORS]
        flag = active[i] and near[i] and sees_obstacle(ring, behind_counts)
        events.interfering[i] = flag
        n_interfering += flag
        n_active += active[i]
        n_present += swarm.present[i]
        n_carrying += active[i] and swarm.carried_object[i] >= 0
    counters[_INTERFERING] += n_interfering
    counters[_ACTIVE] += n_active
    counters[_PRESENT] += n_present
    counters[_CARRYING] += n_carrying
    if n_active > 0:
        events.interference_sum[0] += n_interfering / n_active


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
