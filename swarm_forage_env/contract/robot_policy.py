"""RobotPolicy: a policy of one function for one robot, which numba compiles and which is called for all of them.

What robots remember is handed over as bytes, so that the world's tick is compiled once for all of these policies.
"""

import dis
import inspect
import re
import traceback
from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from swarm_forage_env._internal.fields import ConfigError, known_keys, whole
from swarm_forage_env._internal.wording import shown
from swarm_forage_env.contract.codes import Grip
from swarm_forage_env.contract.kernel_policy import KernelPolicy
from swarm_forage_env.contract.layout import ObservationLayout
from swarm_forage_env.contract.policy import COMMANDS, SwarmSpec
from swarm_forage_env.contract.types import BoolArray, FloatArray, ObsArray

# isort: split
from numba import njit, typeof, types

_OF_THE_COMPILER = "Failed in ", "Enable logging "  # lines of numba's messages, which end with what led to the error
_LED_TO_IT = re.compile(r"^During: |^File \"|Raised from ", re.MULTILINE)
_PLACE = re.compile(r"(?:at|from) (?!.*[/\\]numba[/\\])(.+) \((\d+)\)\s*$", re.MULTILINE)  # the innermost comes first
_ACTION = "(left wheel, right wheel, gripper), three finite numbers"


class StepError(ConfigError):
    """A `RobotPolicy` whose `step` cannot be compiled, or failed, or whose memory or parameters are no such numbers."""


class RobotPolicy(KernelPolicy):
    """Every robot decides by one function, which is compiled: runs then need no Python between ticks.

    A subclass writes `step`, and `numba.njit` above functions that it calls. It may state what follows. An instance
    drives one run.

    Attributes:
        memory: Name -> what a robot remembers when a run starts: a truth value or number, or some of one kind.
        parameters: Name -> what all robots know; keyword arguments of the class change it, of the same kind and shape.
        draws: How many random numbers a robot gets in every tick.
        reads: See `Policy`; `see` has these slices and no others.

    Raises:
        StepError: see there; of a `step` that cannot be compiled by `reset`, of one that fails by `act`.
    """

    memory: ClassVar[Mapping[str, Any]] = {}
    parameters: Mapping[str, Any] = {}
    draws: ClassVar[int] = 1

    @staticmethod
    def step(see: Any, robot: Any, chance: Any, known: Any) -> tuple[float, float, float]:
        """Choose the action of one robot in one tick: left wheel, right wheel and gripper, in [-1, 1].

        Args:
            see: What it observes: slices by their names, `see.proximity[0]`; a slice of one column is a number.
            robot: What it remembers, `robot.name`, to be read and written. It is kept while the robot is in repair.
            chance: (draws,) uniform random numbers in [0, 1), the only ones that the seed of a run reaches.
            known: What all robots know: the numbers of `SwarmSpec`, `known.arena_size_m[0]`, and the parameters.
        """
        raise NotImplementedError

    def __init__(self, **parameters: Any) -> None:
        known_keys(parameters, self.parameters, f"parameter of {type(self).__name__}")
        for name, value in parameters.items():
            given, default = np.asarray(value), np.asarray(self.parameters[name])
            if given.shape != default.shape or not np.can_cast(given.dtype, default.dtype):
                like = f"the kind and shape of its default {shown(default.tolist())}"
                raise StepError(f"Expected parameter {name} to have {like}, got {shown(value)}.")
            self.parameters = {**self.parameters, name: given.astype(default.dtype)[()]}

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        cls.step = staticmethod(getattr(cls.step, "py_func", cls.step))  # it may be decorated with `numba.njit`
        if len(asked := tuple(inspect.signature(cls.step).parameters)) != 4:
            raise StepError(f"Expected {cls.__name__}.step to take see, robot, chance, known and no self, got {asked}.")
        whole(f"draws of {cls.__name__}", cls.draws, at_least=0)
        _record(cls.memory, "memory")
        _record(cls.parameters, "parameters")

    def reset(self, spec: SwarmSpec, rng: np.random.Generator) -> None:
        """Start a run: every robot remembers what `memory` says."""
        told = {field.name: getattr(spec, field.name) for field in fields(spec)}
        numbers = {name: value for name, value in told.items() if isinstance(value, bool | int | float | tuple)}
        robot, known = _record(self.memory, "memory"), _record({**numbers, **self.parameters}, "parameters")
        self._types = (_see_type(spec.layout, getattr(self, "reads", None)), robot.dtype, known.dtype)
        self._carrying = spec.layout.part("carrying").start
        self._kernel  # noqa: B018 - it is compiled by being asked for
        robots, before = np.repeat(robot.view(np.uint8), spec.n_robots, axis=0), robot.view(np.uint8)
        seen, failed = np.zeros((1, spec.layout.size), np.float32), np.full(2, -1, np.int64)
        actions = np.zeros((spec.n_robots, COMMANDS), np.float32)
        self._start(spec, rng, self.draws, known.view(np.uint8), robots, before, seen, failed, actions)

    @property
    def robots(self) -> np.ndarray:
        """(N,) records of what the robots remember, a copy: `policy.robots["name"]`."""
        return self._state[1].view(self._types[1])[:, 0].copy()

    @property
    def _kernel(self) -> Callable[..., None]:  # type: ignore[override] - made of the types of a run
        return _kernel_of(type(self).step, self._types, self._carrying)

    def after_ticks(self) -> None:
        """Raise what `step` has raised as a StepError, found by asking it once more, in Python, with what it got."""
        known, _, before, seen, failed, _ = self._state
        if failed[0] < 0:
            return
        see, robot, known = (a.copy().view(of)[0, 0] for a, of in zip((seen, before, known), self._types, strict=True))
        cause, chance = None, self._chance.row(failed[1])[failed[0]]
        try:
            with np.errstate(divide="raise", invalid="raise"):
                told = shown(self.step(see, robot, chance, known))
        except Exception as error:  # noqa: BLE001 - whatever it is, it is told
            frame = traceback.extract_tb(error.__traceback__)[1]
            cause, told = error, f"{type(error).__name__}: {error} ({frame.filename}:{frame.lineno})"
        expected = f"Expected {type(self).__name__}.step to return {_ACTION}"
        raise StepError(f"{expected}, got {told}, for robot_{failed[0]} in tick {failed[1]}.") from cause


@lru_cache(64)  # notebooks define classes again and again
def _kernel_of(step: Any, kinds: tuple[np.dtype[Any], ...], carrying: int) -> Callable[..., None]:
    """Return one tick of all robots, compiled, by a step for these types of what it sees, remembers and knows."""
    see_type, robot_type, known_type = kinds
    function = _compiled(step, *(typeof(np.zeros(1, kind)[0]) for kind in kinds))

    def step_all(obs: ObsArray, active: BoolArray, draws: FloatArray, state: tuple[Any, ...], now: int) -> None:
        """Ask every active robot. Where its step fails, its action is NaN, which no world takes: the run ends there."""
        known_bytes, memory, before, seen, failed, actions = state
        see, robots, known = obs.view(see_type), memory.view(robot_type), known_bytes.view(known_type)
        for i in range(active.shape[0]):
            action = actions[i]
            if not active[i]:  # it keeps its cargo, see `baselines`
                action[0], action[1], action[2] = 0.0, 0.0, Grip.GRASP if obs[i, carrying] > 0.5 else Grip.RELEASE
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
            action[0] = np.nan
            return

    return njit(error_model="numpy")(step_all)


def _compiled(step: Any, see: Any, robot: Any, known: Any) -> Any:
    """Compile a step for arguments of these types; raises StepError if numba cannot, or for another result."""
    function, kinds, code = njit(boundscheck=True)(step), (see, robot, types.float64[::1], known), step.__code__
    if function is step:  # the compiler is switched off
        return step
    expected, file, line = f"Expected {step.__qualname__} ", code.co_filename, code.co_firstlineno
    try:
        function.compile(kinds)
    except Exception as error:  # numba has errors of many kinds; of an unknown field of a record it raises KeyError
        line = getattr(getattr(error, "loc", None), "line", line)
        if place := _PLACE.search(str(error)):
            file, line = place.groups()
        said = [text for text in map(str.strip, _LED_TO_IT.split(str(error))[0].splitlines()) if text]
        told = " ".join([text for text in said if not text.startswith(_OF_THE_COMPILER)][:2]).rstrip(".")
        if isinstance(error, KeyError):
            places = [i.positions for i in dis.get_instructions(code) if i.argval == error.args[0]]
            told, line = f"no field {error}", getattr(places[0], "lineno", line) if places else line
        expected += "and what it calls under numba.njit to be Python that numba compiles"
        raise StepError(f"{expected}, got {told} ({file}:{line}).") from error
    result: Any = function.overloads[kinds].signature.return_type
    parts: Any = result if isinstance(result, types.BaseTuple) else ()
    if len(parts) != COMMANDS or not all(isinstance(part, types.Number | types.Boolean) for part in parts):
        raise StepError(f"{expected}({file}:{line}) to return {_ACTION}, got {types.unliteral(result)!s:.80}.")
    return function


def _see_type(layout: ObservationLayout, reads: tuple[str, ...] | None) -> np.dtype[Any]:
    """Return the type of one observation as a record of the slices that are read."""
    wanted = None if reads is None else [name.removesuffix(" if carrying") for name in reads]
    parts = [part for part in layout if wanted is None or part.name in wanted]
    formats = [(np.float32, (part.size,) if part.size > 1 else ()) for part in parts]
    names, offsets = [part.name for part in parts], [part.start * 4 for part in parts]
    described: Any = {"names": names, "formats": formats, "offsets": offsets, "itemsize": layout.size * 4}
    return np.dtype((np.record, described))


def _record(values: Mapping[str, Any], what: str) -> np.ndarray:
    """Return (1, 1) a record of values; raises StepError for a name no attribute can have, or what is no number."""
    arrays = {name: np.asarray(value) for name, value in (values or {"nothing": False}).items()}
    for name, array in arrays.items():
        if not name.isidentifier() or hasattr(np.record, name) or array.dtype.kind not in "biuf":
            like = "numbers, or True or False, under names that numpy's records leave free"
            raise StepError(f"Expected the {what} to be {like}, got {name!r}: {shown(values[name])}.")
    kind = np.dtype([(name, array.dtype, array.shape) for name, array in arrays.items()], align=True)
    record = np.zeros((1, 1), np.dtype((np.record, kind)))
    record[0, 0] = tuple(arrays.values())
    return record
