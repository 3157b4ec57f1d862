"""RobotPolicy: a policy of one function for one robot, which is compiled and called for all of them.

What the robots remember is handed over as bytes. So the compiled tick of the world, which takes much longer to compile
than such a function, is the same for all of these policies.
"""

import inspect
import traceback
from collections import namedtuple
from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import lru_cache
from typing import Any, ClassVar, NamedTuple

import numpy as np

from swarm_forage_env._internal.compiling import is_compiled, kernel_of_process
from swarm_forage_env._internal.fields import ConfigError, known_keys, whole
from swarm_forage_env._internal.own_code import (
    OwnCodeError,
    are_numbers,
    own_kernel,
    own_randomness,
    told_of,
    type_of_result,
)
from swarm_forage_env._internal.wording import shown
from swarm_forage_env.contract.codes import Grip
from swarm_forage_env.contract.kernel_policy import KernelPolicy
from swarm_forage_env.contract.layout import LIGHT_IF_CARRYING, ObservationLayout
from swarm_forage_env.contract.policy import COMMANDS, SwarmSpec
from swarm_forage_env.contract.types import BoolArray, FloatArray, ObsArray

ARGUMENTS = ("see", "robot", "chance", "known")
"""What `step` is given, in this order; a policy may call them as it likes."""
ACTION = "(left wheel, right wheel, gripper), three finite numbers"
_GRIPS = {name: value for name, value in vars(Grip).items() if name.isupper()}
_INSTEAD = {Grip: namedtuple("Grip", _GRIPS)(**_GRIPS)}
"""Classes that numba does not know -> what stands for them in compiled code."""
_OF_EACH_ROBOT = ("object_reach_cells", "cache_reach_cells")
"""Fields of the specification that `known` leaves out: with them, another swarm would be another type."""
_WIDTHS = {"b": np.bool_, "i": np.int64, "f": np.float64}
"""Kind of a number, as numpy names it -> its type in a record."""

_KINDS = {"b": "True or False", "i": "whole numbers", "f": "numbers"}
"""Kind of a number -> words for it."""


class StepError(ConfigError):
    """A `RobotPolicy` whose `step` cannot be compiled, or failed, or whose memory or parameters make no sense."""


class _Types(NamedTuple):
    """Types of the records that `step` is given."""

    see: np.dtype[Any]
    robot: np.dtype[Any]
    known: np.dtype[Any]


class RobotPolicy(KernelPolicy):
    """Every robot decides by one function, which is compiled: runs then need no Python between ticks.

    A subclass writes `step` and may state what follows. An instance drives one run.

    Attributes:
        memory: Name -> what a robot remembers at the start of a run: a bool, a whole number, a float, or some of one
            kind. The types stay.
        parameters: Name -> number or numbers that all robots know; keyword arguments of the class change them. Kinds
            and shapes stay.
        draws: How many random numbers a robot gets in every tick.
        reads: See `Policy`; `see` has these slices and no others.

    Raises:
        StepError: an argument of another kind or shape than its default; when the class is made, a `step` with other
            arguments, or memory or parameters that are no numbers; in `reset`, a `step` that cannot be compiled, or
            draws from other than `chance`; in `act`, one that raises.
    """

    memory: ClassVar[Mapping[str, Any]] = {}
    parameters: Mapping[str, Any] = {}
    draws: ClassVar[int] = 1

    @staticmethod
    def step(see: Any, robot: Any, chance: Any, known: Any) -> tuple[float, float, float]:
        """Choose the action of one robot in one tick.

        Args:
            see: What it observes: slices by their names, `see.proximity[0]`; a slice of one column is a number.
            robot: What it remembers, `robot.name`, to be read and written. It is kept while the robot is in repair.
            chance: (draws,) uniform random numbers in [0, 1).
            known: What all robots know: the numbers of `SwarmSpec`, `known.arena_size_m[0]`, and the parameters.

        Returns:
            Left wheel, right wheel and gripper, in [-1, 1].
        """
        raise NotImplementedError

    def __init__(self, **parameters: Any) -> None:
        known_keys(parameters, self.parameters, f"parameter of {type(self).__name__}")
        name = f"the parameters of {type(self).__name__}"
        cast = {
            each: _as_default(f"{each} in {name}", value, self.parameters[each]) for each, value in parameters.items()
        }
        self.parameters = {**self.parameters, **cast}

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        name = cls.__name__
        asked = [parameter.name for parameter in inspect.signature(cls.step).parameters.values()]
        if len(asked) != len(ARGUMENTS):
            raise StepError(
                f"Expected {name}.step to take {', '.join(ARGUMENTS)} and nothing else, got a function of "
                f"{', '.join(asked) or 'nothing'}; one robot decides, so it has no self."
            )
        whole(f"draws of {name}", cls.draws, at_least=0)
        _record(cls.memory, f"memory of {name}")
        _record(cls.parameters, f"parameters of {name}")
        taken = cls.parameters.keys() & {field.name for field in fields(SwarmSpec)}
        if taken:
            raise StepError(
                f"Expected another name in the parameters of {name}, got {min(taken)!r}, which is one of SwarmSpec."
            )

    def reset(self, spec: SwarmSpec, rng: np.random.Generator) -> None:
        """Start a run: every robot remembers what `memory` says."""
        name = type(self).__name__
        drawn_from = own_randomness(self._step_of_class)
        if drawn_from is not None:
            raise StepError(
                f"Expected {name}.step to draw from chance alone, got {drawn_from}, which the seed of a run does not "
                "reach. Take numbers of chance; draws says how many a robot gets in every tick."
            )
        robot = _record(self.memory, f"memory of {name}")
        known = _record(_numbers_of(spec) | dict(self.parameters), f"parameters of {name}")
        self._types = _Types(_see_type(spec.layout, getattr(self, "reads", None)), robot.dtype, known.dtype)
        self._carrying = spec.layout.part("carrying").start
        try:
            self._kernel  # noqa: B018 - it is compiled by being asked for
        except OwnCodeError as error:
            raise StepError(
                f"Expected {name}.step to be Python that numba compiles, got {error}. What it can use stands in "
                "docs/policies.md, A fast one."
            ) from error
        robots = np.repeat(_bytes(robot), spec.n_robots, axis=0)
        failed = np.full(2, -1, np.int64)
        seen, drawn = np.zeros((1, spec.layout.size), np.float32), np.zeros(self.draws)
        actions = np.zeros((spec.n_robots, COMMANDS), np.float32)
        self._start(spec, rng, self.draws, _bytes(known), robots, _bytes(robot), seen, drawn, failed, actions)

    @property
    def robots(self) -> np.ndarray:
        """(N,) records of what the robots remember, a copy: `policy.robots["name"]`."""
        return self._state[1].view(self._types.robot)[:, 0].copy()

    @property
    def _kernel(self) -> Callable[..., None]:  # type: ignore[override] - made of the types of a run
        return _kernel_of(self._step_of_class, self._types, self._carrying)[1]

    @property
    def _step_of_class(self) -> Callable[..., Any]:
        return type(self).step

    def check_ticks(self) -> None:
        """Raise what `step` has raised.

        Raises:
            StepError: names the policy, the exception, and where and when it was.
        """
        *_, failed, _ = self._state
        if failed[0] >= 0:
            told, error = self._failure()
            raise StepError(
                f"Expected {type(self).__name__}.step to return {ACTION}, got {told}, for robot_{failed[0]} in tick "
                f"{failed[1]}."
            ) from error

    def _failure(self) -> tuple[str, Exception | None]:
        """Ask `step` once more, with what it was given when it failed; return words about what comes, and the error."""
        function = _kernel_of(self._step_of_class, self._types, self._carrying)[0]
        try:
            returned = function(*self._given_last())
        except Exception as error:  # noqa: BLE001 - whatever it is, it is told
            line = self._line_of(error)
            if line is None:  # of an index out of range, for example, compiled code does not know it
                try:
                    with np.errstate(divide="raise", invalid="raise"):
                        self._step_of_class(*self._given_last())
                except Exception as other:  # noqa: BLE001 - as above
                    line = self._line_of(other)
            place = "" if line is None else f" (line {line})"
            return f"{type(error).__name__}: {' '.join(str(error).split()) or 'no message'}{place}", error
        return shown(returned), None

    def _given_last(self) -> tuple[Any, ...]:
        """Return what `step` was given when it failed."""
        known, _, before, seen, drawn, _, _ = self._state
        see, robot = seen.view(self._types.see)[0, 0], before.copy().view(self._types.robot)[0, 0]
        return see, robot, drawn, known.view(self._types.known)[0, 0]

    def _line_of(self, error: Exception) -> int | None:
        """Return the line of the policy's file from which an error comes."""
        file = self._step_of_class.__code__.co_filename
        lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
        return lines[-1] if lines else None


@lru_cache(64)  # notebooks define classes again and again
def _kernel_of(
    step: Callable[..., Any], kinds: _Types, carrying: int
) -> tuple[Callable[..., Any], Callable[..., None]]:
    """Return a step, and one tick of all robots by it, both compiled.

    Args:
        step: Of a policy.
        kinds: Types of its arguments.
        carrying: Column of the observation that tells whether a robot carries an object.

    Raises:
        OwnCodeError: the step cannot be compiled, or returns no action.
    """
    see_type, robot_type, known_type = kinds
    function = own_kernel(step, _INSTEAD)
    if is_compiled(function):
        records = (np.zeros(1, kind)[0] for kind in kinds)
        example: dict[str, Any] = dict(
            zip(ARGUMENTS, (next(records), next(records), np.zeros(0), next(records)), strict=True)
        )
        returned = type_of_result(function, example)
        if not are_numbers(returned, COMMANDS):
            raise OwnCodeError(f"a function that returns {told_of(returned)} in the place of {ACTION}")

    def step_all(obs: ObsArray, active: BoolArray, draws: FloatArray, state: tuple[Any, ...], now: int) -> None:
        """Ask every active robot. Where its step fails, its action is NaN, which no world takes: the run ends there."""
        known_bytes, memory, before, seen, drawn, failed, actions = state
        see, robots, known = obs.view(see_type), memory.view(robot_type), known_bytes.view(known_type)
        for i in range(active.shape[0]):
            action = actions[i]
            action[0], action[1] = 0.0, 0.0
            if not active[i]:
                action[2] = GRASP if obs[i, carrying] > 0.5 else RELEASE  # it keeps its cargo, see `baselines`
                continue
            for byte in range(memory.shape[1]):
                before[0, byte] = memory[i, byte]
            try:
                action[0], action[1], action[2] = function(see[i, 0], robots[i, 0], draws[i], known[0, 0])
                if np.isfinite(action[0] + action[1] + action[2]):
                    continue
            except Exception:  # noqa: BLE001 - what it is can be asked by Python only
                pass
            failed[0], failed[1] = i, now
            for column in range(obs.shape[1]):
                seen[0, column] = obs[i, column]
            for column in range(draws.shape[1]):
                drawn[column] = draws[i, column]
            action[0] = np.nan
            return

    return function, kernel_of_process(step_all)


GRASP, RELEASE = Grip.GRASP, Grip.RELEASE


def _see_type(layout: ObservationLayout, reads: tuple[str, ...] | None) -> np.dtype[Any]:
    """Return the type of one observation as a record of the slices that are read."""
    parts = [
        part
        for part in layout
        if reads is None or part.name in reads or (part.name == "light" and LIGHT_IF_CARRYING in reads)
    ]
    described: Any = {
        "names": [part.name for part in parts],
        "formats": [(np.float32, (part.size,) if part.size > 1 else ()) for part in parts],
        "offsets": [part.start * 4 for part in parts],
        "itemsize": layout.size * 4,
    }
    return _with_names(np.dtype(described))


def _with_names(kind: np.dtype[Any]) -> np.dtype[Any]:
    """Return a type of records whose fields are attributes where the compiler is switched off, too."""
    return np.dtype((np.record, kind))


def _record(values: Mapping[str, Any], what: str) -> np.ndarray:
    """Return (1, 1) a record of values.

    Raises:
        StepError: a name that no attribute can have, or a value that is no number, truth value or array of them.
    """
    arrays = {name: np.asarray(value) for name, value in values.items()}
    for name, array in arrays.items():
        if not name.isidentifier() or hasattr(np.record, name):
            raise StepError(
                f"Expected another name in the {what}, got {name!r}; it may have letters, digits and _, and be no word "
                "that numpy's records have of their own, as sum and size."
            )
        if array.dtype.kind not in _WIDTHS:
            raise StepError(
                f"Expected {name} in the {what} to be numbers, or True or False, got {shown(values[name])}."
            )
    described = [(name, _WIDTHS[array.dtype.kind], array.shape) for name, array in arrays.items()]
    record = np.zeros((1, 1), _with_names(np.dtype(described or [("nothing", np.bool_)], align=True)))
    for name, array in arrays.items():
        record[name] = array
    return record


def _as_default(where: str, value: Any, default: Any) -> Any:
    """Return a value in the kind and shape of a default: another kind would make `step` compute something else.

    Raises:
        StepError: another kind, but a whole number where the default is a float is one; or another shape.
    """
    shape, kind = np.shape(default), np.dtype(_WIDTHS[np.asarray(default).dtype.kind])
    try:
        array = np.asarray(value)
    except ValueError:  # rows of unequal length
        array = np.asarray(None)
    is_kind = array.dtype.kind in "biuf" and (array.dtype.kind == "b") == (kind.kind == "b")
    if array.shape != shape or not is_kind or not np.can_cast(array.dtype, kind):
        shaped = f" in the shape {shape}" if shape else ", a single one"
        raise StepError(
            f"Expected {where} to be {_KINDS[kind.kind]}{shaped}, as its default {shown(default)}, got {shown(value)}. "
            "Give a value of that kind, or change the default in the class."
        )
    return array.astype(kind)[()]


def _bytes(record: np.ndarray) -> np.ndarray:
    """Return (1, bytes) those of a record."""
    return record.view(np.uint8)


def _numbers_of(spec: SwarmSpec) -> dict[str, Any]:
    """Return the fields of a specification that are numbers, and the same for all robots."""
    found = {field.name: getattr(spec, field.name) for field in fields(spec) if field.name not in _OF_EACH_ROBOT}
    return {name: value for name, value in found.items() if isinstance(value, bool | int | float | tuple)}
