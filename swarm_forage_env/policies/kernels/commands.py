"""From a learner's actions to commands of the contract: motions by number, automatic gripper, masks."""

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.codes import Grip
from swarm_forage_env.contract.detection import sees_cache, sees_nest
from swarm_forage_env.contract.layout import GROUND_SENSORS
from swarm_forage_env.contract.types import ActionArray, BoolArray, IntArray, ObsArray
from swarm_forage_env.policies.kernels.compact import is_over_object

GRASP = float(Grip.GRASP)
RELEASE = float(Grip.RELEASE)
DELIVER = float(Grip.DELIVER)
N_MOTIONS = 6
"""Motions by number: stand, forward, arc left, arc right, turn left, turn right."""
ACT_GRASP, ACT_RELEASE, ACT_DELIVER, ACT_SITE, ACT_CREATE_CACHE = 6, 7, 8, 9, 10
"""Numbers of the gripper actions; the wheels stand still, as in the interaction."""
N_GRIPS = 5


@kernel
def idle_grip(row: ObsArray, carrying: int) -> float:
    """Gripper command without a request: hold when carrying, release when empty."""
    return GRASP if row[carrying] > 0.5 else RELEASE


@kernel
def automatic_grip(obs: ObsArray, starts: tuple[int, int, int], actions: ActionArray) -> None:
    """Write the gripper column: grasp when empty and over an object or a cache, deliver when carrying in the nest.

    `starts` = first columns of ground, carrying, los_object.
    """
    ground, carrying, window = starts
    for i in range(obs.shape[0]):
        row = obs[i]
        below = row[ground : ground + GROUND_SENSORS]
        grip = idle_grip(row, carrying)
        if row[carrying] > 0.5:
            if sees_nest(below):
                grip = DELIVER
        elif is_over_object(row, window) or sees_cache(below):
            grip = GRASP
        actions[i, 2] = grip


@kernel
def numbered_actions(
    chosen: IntArray, wheels: ActionArray, grips: ActionArray, obs: ObsArray, carrying: int, actions: ActionArray
) -> None:
    """Write (N, 3) commands for actions by number.

    `wheels` = (N_MOTIONS, 2) wheel commands per motion; `grips` = (N_GRIPS,) command per gripper action.
    """
    for i in range(chosen.shape[0]):
        number = chosen[i]
        if number < N_MOTIONS:
            actions[i, 0] = wheels[number, 0]
            actions[i, 1] = wheels[number, 1]
            actions[i, 2] = idle_grip(obs[i], carrying)
        else:
            actions[i, 0] = 0.0
            actions[i, 1] = 0.0
            actions[i, 2] = grips[number - N_MOTIONS]


@kernel
def mask_actions(obs: ObsArray, starts: tuple[int, int, int, int, int], dynamic_caches: bool, mask: BoolArray) -> None:
    """Write which actions make sense, (N, N_MOTIONS) or (N, N_MOTIONS + N_GRIPS); at least one per row.

    `starts` = first columns of ground, carrying, interacting, active, los_object. During an interaction, only `stand`
    makes sense if the gripper is automatic; otherwise only gripper actions do, because a motion would cancel it.
    """
    ground, carrying, interacting, active, window = starts
    with_grips = mask.shape[1] > N_MOTIONS
    for i in range(obs.shape[0]):
        row = obs[i]
        allowed = mask[i]
        allowed[:] = False
        if row[active] < 0.5:
            allowed[0] = True
            continue
        busy = row[interacting] > 0.5
        allowed[:N_MOTIONS] = not busy
        if not with_grips:
            allowed[0] = True
            continue
        below = row[ground : ground + GROUND_SENSORS]
        if row[carrying] > 0.5:
            in_nest = sees_nest(below)
            allowed[ACT_RELEASE] = True
            allowed[ACT_DELIVER] = in_nest or sees_cache(below)
            allowed[ACT_SITE] = dynamic_caches and not in_nest
            allowed[ACT_CREATE_CACHE] = allowed[ACT_SITE]
        else:
            allowed[ACT_GRASP] = busy or is_over_object(row, window) or sees_cache(below)
