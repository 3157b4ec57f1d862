"""Where the published description and its authors' program disagree: one switch per difference.

The default is always the description. `AUTHORS_PROGRAM` turns every switch on, so that a study can find out which of
the two gives a published result. A quirk is a single `if` at the place where it acts.

Not reproduced at all: two-cell ramp objects, the rule that objects may not touch, throttling before the speed
cap, and interference counted from each controller's machine state.
"""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True, slots=True)
class Quirks:
    """Deviations of the authors' program; every field is False for the behaviour as described."""

    integer_estimates: bool = False
    """Task estimates in integer arithmetic; the partition probability starts at gamma/2 before estimates are seeded."""
    exec_time_since_last_completion: bool = False
    """Execution time runs from the last completion of that task, not from the start of this execution."""
    interface_flag_survives_abort: bool = False
    """An abort leaves the task interface marked active for that task's next execution."""
    transferer_interface_never_leaves: bool = False
    """A Cache Transferer's destination interface is never left and its source interface never becomes active."""
    cache_forget_unit_mismatch: bool = False
    """The rule for forgetting a cache compares metres with cell indices, and one axis suffices."""
    finisher_tolerance_mismatch: bool = False
    """A Cache Finisher arrives at one distance and is accepted at another; starting within tolerance is no arrival."""
    explore_double_start: bool = False
    """The exploration strategy runs twice in its first tick."""
    site_box_truncated: bool = False
    """The box of allowed cache sites is truncated to whole metres."""
    dynamic_cache_merges_all: bool = False
    """A new dynamic cache collects all usable objects, wherever they lie, and never forms in the random placement."""
    dynamic_cache_avoids_clusters: bool = False
    """A new dynamic cache never stands on a power-law cluster; where clusters leave it no room, there is none."""
    motion_self_conflict: bool = False
    """A randomly walking object conflicts with its own old place, so only few cell borders can be crossed."""
    serialized_interactions: bool = False
    """At most one interaction per kind finishes in a tick, swarm-wide."""


AUTHORS_PROGRAM = Quirks(
    integer_estimates=True,
    exec_time_since_last_completion=True,
    interface_flag_survives_abort=True,
    transferer_interface_never_leaves=True,
    cache_forget_unit_mismatch=True,
    finisher_tolerance_mismatch=True,
    explore_double_start=True,
    site_box_truncated=True,
    dynamic_cache_merges_all=True,
    dynamic_cache_avoids_clusters=True,
    motion_self_conflict=True,
    serialized_interactions=True,
)
"""All quirks on: the authors' program as far as this package reproduces it."""
