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
MOTION_WHEELS = {
    "stand": (0.0, 0.0),
    "forward": (0.5, 0.5),
    "arc left": (0.4, 0.6),
    "arc right": (0.6, 0.4),
    "turn left": (-0.25, 0.25),
    "turn right": (0.25, -0.25),
}
"""Discrete actions that move, in order, and their wheel commands (our choice): full speed, arcs of 0.35 m radius, turns
of 8 degrees per tick."""
GRIP_COMMANDS = {
    "grasp": Grip.GRASP,
    "release": Grip.RELEASE,
    "deliver": Grip.DELIVER,
    "site": Grip.SITE,
    "create_cache": Grip.CREATE_CACHE,
}
"""Discrete actions of the gripper, in order after the motions; wheels stand meanwhile, as they would in the
interaction."""
N_MOTIONS = len(MOTION_WHEELS)
N_GRIPS = len(GRIP_COMMANDS)
_NUMBERS = {name: number for number, name in enumerate((*MOTION_WHEELS, *GRIP_COMMANDS))}
_STAND = _NUMBERS["stand"]
_GRASP, _RELEASE, _DELIVER = _NUMBERS["grasp"], _NUMBERS["release"], _NUMBERS["deliver"]
_SITE, _CREATE_CACHE = _NUMBERS["site"], _NUMBERS["create_cache"]


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
            allowed[_STAND] = True
            continue
        busy = row[interacting] > 0.5
        allowed[:N_MOTIONS] = not busy
        if not with_grips:
            allowed[_STAND] = True
            continue
        below = row[ground : ground + GROUND_SENSORS]
        if row[carrying] > 0.5:
            in_nest = sees_nest(below)
            allowed[_RELEASE] = True
            allowed[_DELIVER] = in_nest or sees_cache(below)
            allowed[_SITE] = dynamic_caches and not in_nest
            allowed[_CREATE_CACHE] = allowed[_SITE]
        else:
            allowed[_GRASP] = busy or is_over_object(row, window) or sees_cache(below)
