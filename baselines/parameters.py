"""Numbers of the controllers: what is common to all four, and how numbers reach the compiled kernels.

Sources: "study" is the controller configuration published with the paper's experiments. Speeds are the lengths of
steering forces: the velocity that a force alone would make the robot drive with.
"""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from swarm_forage_env._internal.wording import suggestion
from swarm_forage_env.contract.policy import SwarmSpec

COLUMNS = (
    "proximity",
    "light",
    "ground",
    "wheel_speed",
    "position",
    "heading",
    "carrying",
    "cargo",
    "event_object",
    "event",
    "event_cache",
    "los_cell",
    "los_object",
    "los_cache",
)
"""Observation slices whose first columns the kernels know by name."""


PAPER_SPEED_MPS = 0.1
"""Top speed of the paper's robots."""


class ParameterError(ValueError):
    """A controller parameter that is unknown or makes no sense; the message says what was expected."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ControllerParameters:
    """Steering, exploration and homing of a foot-bot, shared by all controllers.

    Speeds are those of robots with a top speed of `PAPER_SPEED_MPS`; others drive at the same shares of their own.
    """

    wander_speed_mps: float = 0.09
    """Length of the wander force; study: 9 cm/s."""
    wander_circle_radius: float = 100.0
    """Radius of the wander circle; only its ratio to the distance matters; study."""
    wander_circle_distance: float = 4.0
    """How far the centre of the wander circle lies behind the robot; study."""
    wander_max_change_deg: float = 5.0
    """Largest change of the wander angle per tick, and bound of that angle; study."""
    avoidance_speed_mps: float = 0.08
    """Length of the avoidance force; study: 8 cm/s."""
    phototaxis_speed_mps: float = 0.08
    """Length of the force towards the nest light; study: 8 cm/s."""
    arrival_speed_mps: float = 0.08
    """Length of the force towards a point outside the slowing radius; study: 8 cm/s."""
    slowest_arrival_mps: float = 0.01
    """Shortest force towards a point; study: 1 cm/s."""
    slowing_radius_m: float = 0.2
    """Within this distance of its goal a robot slows down; study."""
    approach_ignores_obstacles: bool = True
    """Whether a robot that slows down at its goal ignores obstacles; authors' program, the paper has no such rule."""
    recovery_speed_mps: float = 0.07
    """Length of the straight-ahead force after avoiding; authors' program: 0.7 of the maximum speed."""
    recovery_s: float = 2.0
    """How long a robot drives straight on after avoiding; authors' program: 10 ticks."""
    standing_speed_mps: float = 0.001
    """A robot that avoids at most this fast also wanders, to break free; authors' program: 0.1 cm/s."""
    longest_turn_s: float = 2.4
    """A homing robot that has only turned on the spot for longer also wanders, to break free; our choice: half a turn
    takes 2.2 s."""
    detour_after_s: float = 20.0
    """In a world with obstacles, a homing robot that has not come `detour_way_m` further for so long begins a detour
    along what is in its way; our choice: light and avoidance cancel before a wide wall, and the paper has none."""
    detour_way_m: float = 0.5
    """See `detour_after_s`; our choice: more than a robot is pushed to and fro on one spot."""
    detour_longest_s: float = 400.0
    """Longest detour, in which a robot drives about 32 m; short ones are likelier. Our choice."""
    soft_turn_deg: float = 15.0
    """Force angles up to this are driven as arcs, larger ones as turns on the spot; study."""
    exploration_lock_s: float = 10.0
    """An exploring robot ignores objects under it for this long; authors' program: 50 ticks."""
    drop_depth_min_m: float = 0.01
    """Lower end of the uniform drop distance from the nest centre; authors' program."""

    def __post_init__(self) -> None:
        # Checked here and not by `swarm_forage_env._internal.fields`: baselines know the contract and two small tools,
        # nothing else.
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if isinstance(field.default, bool):
                if not isinstance(value, bool):
                    raise ParameterError(f"Expected {field.name} to be True or False, got {value!r}.")
                continue
            is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
            if not is_number or not math.isfinite(value) or value < 0:
                raise ParameterError(f"Expected {field.name} to be a finite number >= 0, got {value!r}.")
        for name in ("wander_max_change_deg", "soft_turn_deg", "slowing_radius_m"):
            if getattr(self, name) == 0:
                raise ParameterError(f"Expected {name} > 0, got 0.")
        if self.wander_circle_radius <= self.wander_circle_distance:
            raise ParameterError(
                f"Expected wander_circle_radius > wander_circle_distance = {self.wander_circle_distance}, "
                f"got {self.wander_circle_radius}; otherwise the robot would wander backwards."
            )


P = TypeVar("P", bound=ControllerParameters)


def chosen_parameters(default: P, parameters: P | None, overrides: Mapping[str, float]) -> P:
    """Return `parameters`, or `default` without any, with single numbers replaced by name.

    Raises:
        ParameterError: parameters of another controller, an unknown name (with the nearest known one), or a value that
            makes no sense.
    """
    parameters = default if parameters is None else parameters
    if not isinstance(parameters, type(default)):
        raise ParameterError(
            f"Expected parameters to be {type(default).__name__}, got {type(parameters).__name__}; "
            "give single numbers by name, as in wander_speed_mps=0.07."
        )
    known = [field.name for field in dataclasses.fields(parameters)]
    for name in overrides:
        if name not in known:
            raise ParameterError(
                f"Unknown controller parameter {name!r}.{suggestion(name, known)} Known: {', '.join(known)}."
            )
    return dataclasses.replace(parameters, **overrides)


def wander_series(parameters: ControllerParameters) -> dict[str, float]:
    """Return coefficients for the angle of the wander force, in rad, as a series in the wander angle w, in degrees.

    The angle of R (cos w, sin w) - (D, 0) is w + sum over n >= 1 of (D / R)^n sin(n w) / n. With the series of the
    sines, six odd powers of w give it to 14 digits, as long as D / R <= 0.1 and |w| <= 0.2 rad.

    Returns:
        "has_wander_series", 1 or 0: whether that holds; "wander_series_0" to "wander_series_5": the coefficients.
    """
    ratio = parameters.wander_circle_distance / parameters.wander_circle_radius
    holds = ratio <= 0.1 and math.radians(parameters.wander_max_change_deg) <= 0.2
    series: dict[str, float] = {"has_wander_series": int(holds)}
    n = np.arange(1.0, 40.0)
    for k in range(6):
        power = 2 * k + 1
        of_sines = float(np.sum(ratio**n * n ** (2 * k))) * (-1) ** k / math.factorial(power)
        series[f"wander_series_{k}"] = ((k == 0) + of_sines) * math.radians(1.0) ** power
    return series


def kernel_constants(parameters: ControllerParameters, spec: SwarmSpec, **derived: float) -> np.ndarray:
    """Pack everything that stays constant during a run into one record, readable by name inside kernels.

    Args:
        parameters: All fields are passed on under their own names, as float64; speeds as shares of the robots' own.
        spec: Observation columns, scales, drive limits, nest and quirks (0 or 1) of this run.
        derived: Further numbers that a controller computes once; whole ones stay whole.

    Returns:
        (1,) record array; `constants[0].name` works compiled and uncompiled.
    """
    half_width_m, half_height_m = spec.layout.part("position").scale
    share = spec.max_speed_mps / PAPER_SPEED_MPS
    values: dict[str, Any] = {name: spec.layout.part(name).start for name in COLUMNS}
    values |= {name: int(is_on) for name, is_on in dataclasses.asdict(spec.quirks).items()}
    own = {field.name: float(getattr(parameters, field.name)) for field in dataclasses.fields(parameters)}
    values |= {name: value * share if name.endswith("_mps") else value for name, value in own.items()}
    values |= {
        "n_objects": spec.n_objects,
        "has_obstacles": int(spec.has_obstacles),
        "exploration_lock_ticks": round(parameters.exploration_lock_s / spec.dt_s),
        "longest_turn_ticks": round(parameters.longest_turn_s / spec.dt_s),
        "recovery_ticks": round(parameters.recovery_s / spec.dt_s),
        "detour_after_ticks": round(parameters.detour_after_s / spec.dt_s),
        "detour_longest_ticks": round(parameters.detour_longest_s / spec.dt_s),
        "half_width_m": float(half_width_m),
        "half_height_m": float(half_height_m),
        "cell_m": float(spec.cell_m),
        "wheel_scale_mps": float(spec.wheel_scale_mps),
        "max_speed_mps": float(spec.max_speed_mps),
        "soft_turn_rad": math.radians(parameters.soft_turn_deg),
        "per_soft_turn": 1.0 / math.radians(parameters.soft_turn_deg),
        "per_wheel_scale": 1.0 / spec.wheel_scale_mps,
        "wander_wheel_share": min(values["wander_speed_mps"], spec.max_speed_mps) / spec.wheel_scale_mps,
        **derived,
        **wander_series(parameters),
    }
    nests_m = [((left + right) / 2, (bottom + top) / 2) for left, bottom, right, top in spec.nest_boxes_m]
    numbers = [(name, np.int64 if isinstance(value, int) else np.float64) for name, value in values.items()]
    fields = np.dtype([*numbers, ("nests_m", np.float64, (len(nests_m), 2))], align=True)
    # np.record makes fields readable as attributes also in uncompiled kernels; compiled kernels need no help.
    constants = np.zeros(1, np.dtype((np.record, fields)))
    for name, value in values.items():
        constants[name] = value
    constants["nests_m"] = nests_m
    return constants
