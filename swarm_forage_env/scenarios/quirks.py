"""Where the published description and its authors' program disagree: one switch per difference.

The default is always the description. `AUTHORS_PROGRAM` turns every switch on, so that a study can find out which of
the two gives a published result. A quirk is a single `if` at the place where it acts.

Not reproduced at all: two-cell ramp objects, the rule that objects may not touch, throttling before the speed
cap, and interference counted from each controller's machine state. (Under sensor noise the program counts false
obstacles, too: records have that share in a column of its own, `believed_interference_fraction`.) Contact between
robots is the same in both rules, and so is the rule that a robot ignores obstacles close to its goal, a parameter
of the controllers (`approach_ignores_obstacles`).
"""

from dataclasses import dataclass, fields
from typing import ClassVar

from swarm_forage_env._internal.fields import Checked


@dataclass(frozen=True, kw_only=True, slots=True)
class Quirks(Checked):
    """Deviations of the authors' program; every field is False for the behaviour as described."""

    called: ClassVar[str] = "quirks"

    integer_estimates: bool = False
    """Task estimates in integer arithmetic; the partition probability starts at gamma/2 before estimates are seeded."""
    exec_time_since_last_completion: bool = False
    """Execution time runs from the last completion of that task, not from the start of this execution."""
    interface_flag_survives_abort: bool = False
    """An abort leaves the task interface marked active for that task's next execution."""
    transferer_interface_never_leaves: bool = False
    """A Cache Transferer's destination interface is never left and its source interface never becomes active."""
    transferer_goes_anywhere: bool = False
    """A Cache Transferer brings its object to any other cache, not only to one nearer to the nest."""
    cache_forget_unit_mismatch: bool = False
    """The rule for forgetting a cache compares metres with cell indices, and one axis suffices."""
    cache_goal_by_identity: bool = False
    """A cache created again in the place of the old one is not the goal that a robot had; it chooses again."""
    last_cache_at_every_sight: bool = False
    """The place where a search for caches begins is stored whenever the only known cache is seen again."""
    finisher_tolerance_mismatch: bool = False
    """A Cache Finisher arrives at one distance and is accepted at another; starting within tolerance is no arrival."""
    refusals_not_remembered: bool = False
    """A refused Cache Starter or Finisher chooses again with its own distance, although the world's is larger."""
    no_walk_at_site: bool = False
    """A Cache Starter that stands where it would start a cache drifts towards its choices until one is farther off."""
    scattered_sites: bool = False
    """Cache sites scatter around the best allowed place with a heavy tail; some lie anywhere allowed."""
    waits_for_cache: bool = False
    """A robot that waits in a cache with too few objects stands until there are enough, and does not search anew."""
    only_delivering_counts: bool = False
    """In the nest only the command DELIVER delivers; objects let go or laid down there otherwise are placed again."""
    obstacle_behind_counts: bool = False
    """A summed proximity vector that points straight back is an obstacle whatever its length."""
    pose_sensors_exact: bool = False
    """Sensor noise never acts on positions and headings."""
    nest_left_at_random: bool = False
    """After a delivery robots of CRW and DPO walk at random until they have left the nest."""
    explore_double_start: bool = False
    """The exploration strategy runs twice in its first tick."""
    site_box_truncated: bool = False
    """The box of allowed cache sites is truncated to whole metres."""
    dynamic_cache_merges_all: bool = False
    """A new dynamic cache collects all usable objects, wherever they lie, and never forms in the random placement."""
    dynamic_cache_avoids_clusters: bool = False
    """A new dynamic cache never stands on a power-law cluster; where clusters leave it no room, there is none."""
    large_clusters_likelier: bool = False
    """Power-law clusters are of one or two sizes, the larger one likelier; else of several, smaller ones likelier."""
    motion_self_conflict: bool = False
    """A randomly walking object conflicts with its own old place, so only few cell borders can be crossed."""
    serialized_interactions: bool = False
    """At most one interaction per kind finishes in a tick, swarm-wide."""


QUIRK_NAMES = tuple(field.name for field in fields(Quirks))
"""Every switch, in the order of the class."""
AUTHORS_PROGRAM = Quirks(**dict.fromkeys(QUIRK_NAMES, True))
"""All quirks on: the authors' program as far as this package reproduces it."""
RULES = {"DESCRIBED": Quirks(), "AUTHORS_PROGRAM": AUTHORS_PROGRAM}
"""Both rules by name: as the paper describes them, and as its program has them."""
