"""Slow twins of a learner's actions: commands and masks, from the named slices of the observation row."""

import numpy as np

from swarm_forage_env.contract.codes import Grip
from swarm_forage_env.contract.layout import ObservationLayout
from tests.reference.compact_view import in_band

WHEELS = {
    "stand": (0.0, 0.0),
    "forward": (0.5, 0.5),
    "arc left": (0.4, 0.6),
    "arc right": (0.6, 0.4),
    "turn left": (-0.25, 0.25),
    "turn right": (0.25, -0.25),
}
MOTIONS = list(WHEELS)
GRIPS = [Grip.GRASP, Grip.RELEASE, Grip.DELIVER, Grip.SITE, Grip.CREATE_CACHE]


class Sight:
    """What one robot knows that decides about its gripper."""

    def __init__(self, row: np.ndarray, layout: ObservationLayout) -> None:
        part = {name: row[layout[name]] for name in layout.names}
        self.at_work = part["active"][0] == 1.0
        self.busy = part["interacting"][0] == 1.0
        self.carrying = part["carrying"][0] == 1.0
        self.in_nest = in_band(part["ground"], 0.6, 0.8) >= 3
        self.in_cache = in_band(part["ground"], 0.3, 0.5) >= 3
        self.over_object = part["los_object"][12] > 0.0


def automatic_grip(row: np.ndarray, layout: ObservationLayout) -> Grip:
    """What the gripper does by itself."""
    sight = Sight(row, layout)
    if sight.carrying and sight.in_nest:
        return Grip.DELIVER
    if sight.carrying or sight.over_object or sight.in_cache:
        return Grip.GRASP  # what is carried is held
    return Grip.RELEASE


def numbered_action(number: int, row: np.ndarray, layout: ObservationLayout) -> tuple[float, float, float]:
    """Command of one robot for an action by number: motions first, then what the gripper can do."""
    if number >= len(MOTIONS):
        return (0.0, 0.0, GRIPS[number - len(MOTIONS)])
    return (*WHEELS[MOTIONS[number]], Grip.GRASP if Sight(row, layout).carrying else Grip.RELEASE)


def allowed_actions(row: np.ndarray, layout: ObservationLayout, *, with_grips: bool, dynamic_caches: bool) -> set[int]:
    """Numbers of the actions that make sense for one robot."""
    sight = Sight(row, layout)
    stand = {MOTIONS.index("stand")}
    if not sight.at_work:
        return stand
    motions = set() if sight.busy else set(range(len(MOTIONS)))
    if not with_grips:
        return motions | stand
    grips = set()
    if sight.carrying:
        grips.add(Grip.RELEASE)
        if sight.in_nest or sight.in_cache:
            grips.add(Grip.DELIVER)
        if dynamic_caches and not sight.in_nest:
            grips |= {Grip.SITE, Grip.CREATE_CACHE}
    elif sight.busy or sight.over_object or sight.in_cache:
        grips.add(Grip.GRASP)
    return motions | {len(MOTIONS) + GRIPS.index(grip) for grip in grips}
