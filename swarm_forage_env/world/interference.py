"""Which robots lose time to avoidance. The rule uses geometry only, so it is the same for every policy."""

from swarm_forage_env.contract.types import BoolArray, ObsArray
from swarm_forage_env.world.kernels.interfere import mark
from swarm_forage_env.world.state import StepEvents, SwarmState


def mark_interference(
    swarm: SwarmState, events: StepEvents, obs: ObsArray, proximity: int, near: BoolArray, *, behind_counts: bool
) -> None:
    """Flag active robots for which the obstacle rule holds in this tick, walls included.

    Args:
        swarm: Read: active, present, carried_object.
        events: Written: interfering, counters, interference_sum (share of active robots, 0/0 = 0).
        obs: (N, D) with true proximity readings.
        proximity: Column of the first of them.
        near: (N,) whether any beam may have hit something; others are skipped.
        behind_counts: Quirk `obstacle_behind_counts`.
    """
    mark(
        obs,
        proximity,
        near,
        behind_counts,
        swarm.active,
        swarm.present,
        swarm.carried_object,
        events.interfering,
        events.counters,
        events.interference_sum,
    )
