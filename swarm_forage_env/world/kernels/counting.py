"""What is counted in every tick: who is in interference, who does what, and how the swarm divides over tasks."""

from swarm_forage_env._internal.compiling import inline_kernel, kernel, part
from swarm_forage_env.contract.codes import Counter
from swarm_forage_env.contract.detection import sees_obstacle
from swarm_forage_env.contract.layout import RING_SENSORS
from swarm_forage_env.contract.types import BoolArray, CodeArray, FloatArray, ObsArray
from swarm_forage_env.scenarios.floor import CELL_M, NEAR_CACHE_M
from swarm_forage_env.world.kernels.interact import CACHE_DROP, CACHE_PICKUP, NO_REQUEST
from swarm_forage_env.world.state import CacheState, StepEvents, SwarmState

_INTERFERING, _ACTIVE, _PRESENT = int(Counter.INTERFERING), int(Counter.ACTIVE), int(Counter.PRESENT)
_CARRYING, _AVOIDANCES = int(Counter.CARRYING), int(Counter.AVOIDANCES)
_SEARCHING, _HOMING = int(Counter.SEARCHING), int(Counter.HOMING)
_HANDLING, _AT_CACHES = int(Counter.HANDLING), int(Counter.AT_CACHES)
_NEAR_CACHES = int(Counter.INTERFERING_NEAR_CACHES)


@inline_kernel
def mark(
    obs: ObsArray,
    proximity: int,
    near: BoolArray,
    behind_counts: bool,
    swarm: SwarmState,
    caches: CacheState,
    events: StepEvents,
) -> None:
    """Flag active robots for which the obstacle rule holds in this tick, walls and boxes included, and count the tick.

    The rule uses geometry only, so it is the same for every policy. An active robot is in interference, or handles an
    object, at a cache or elsewhere, or carries one, or does nothing of this, which is called searching.

    Args:
        obs: (N, D) with true proximity readings.
        proximity: Column of the first of them.
        near: (N,) whether any beam may have hit something; others are skipped.
        behind_counts: Quirk `obstacle_behind_counts`.
        swarm: Read.
        caches: Read.
        events: `interfering` is that of the last tick, and written, `counters` are added to, and the share of active
            robots (0/0 = 0) is added to `interference_sum`.
    """
    active, present, position = swarm.active, swarm.present, swarm.position
    carried_object, pending_kind = swarm.carried_object, swarm.pending_kind
    interfering, counters = events.interfering, events.counters
    n_interfering = 0
    n_begun = 0
    n_active = 0
    n_present = 0
    n_carrying = 0
    n_homing = 0
    n_handling = 0
    n_at_caches = 0
    n_near_caches = 0
    for i in range(active.shape[0]):
        ring = obs[i, proximity : proximity + RING_SENSORS]
        flag = active[i] and near[i] and sees_obstacle(ring, behind_counts)
        carries = active[i] and carried_object[i] >= 0
        n_begun += flag and not interfering[i]
        interfering[i] = flag
        n_interfering += flag
        n_near_caches += flag and _is_near_cache(position[i], caches)
        n_active += active[i]
        n_present += present[i]
        n_carrying += carries
        kind = pending_kind[i]
        if kind == NO_REQUEST:
            n_homing += carries and not flag
        elif active[i] and not flag:
            is_at_cache = kind == CACHE_PICKUP or kind == CACHE_DROP
            n_at_caches += is_at_cache
            n_handling += not is_at_cache
    counters[_AVOIDANCES] += n_begun
    counters[_SEARCHING] += n_active - n_interfering - n_homing - n_handling - n_at_caches
    counters[_HOMING] += n_homing
    counters[_HANDLING] += n_handling
    counters[_AT_CACHES] += n_at_caches
    counters[_INTERFERING] += n_interfering
    counters[_NEAR_CACHES] += n_near_caches
    counters[_ACTIVE] += n_active
    counters[_PRESENT] += n_present
    counters[_CARRYING] += n_carrying
    if n_active > 0:
        events.interference_sum[0] += n_interfering / n_active


@part
def _is_near_cache(place: FloatArray, caches: CacheState) -> bool:
    """Whether a place (2,) in m lies within `NEAR_CACHE_M` of the centre of a cache."""
    for slot in range(caches.alive.shape[0]):
        if caches.alive[slot]:
            dx = (caches.cell[slot, 0] + 0.5) * CELL_M - place[0]
            dy = (caches.cell[slot, 1] + 0.5) * CELL_M - place[1]
            if dx * dx + dy * dy <= NEAR_CACHE_M * NEAR_CACHE_M:
                return True
    return False


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
