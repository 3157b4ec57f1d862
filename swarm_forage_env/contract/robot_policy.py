"""RobotPolicy: a policy of one function for one robot, which numba compiles and which is called for all of them.

What the robots remember is handed over as bytes. So the compiled tick of the world, which takes much longer to compile
than such a function, is the same for all of these policies.
"""

import dis
import inspect
import re
import traceback
from collections import namedtuple
from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import lru_cache
from types import FunctionType
from typing import Any, ClassVar

import numpy as np

from swarm_forage_env._internal.compiling import is_compiled, kernel_of_process, type_of
from swarm_forage_env._internal.fields import ConfigError, known_keys, whole
from swarm_forage_env._internal.wording import shown
from swarm_forage_env.contract.codes import Grip
from swarm_forage_env.contract.kernel_policy import KernelPolicy
from swarm_forage_env.contract.layout import LIGHT_IF_CARRYING, ObservationLayout
from swarm_forage_env.contract.policy import COMMANDS, SwarmSpec
from swarm_forage_env.contract.types import BoolArray, FloatArray, ObsArray

# isort: split
from numba import njit, types

ACTION = "(left wheel, right wheel, gripper), three finite numbers"
GRASP, RELEASE = Grip.GRASP, Grip.RELEASE
_GRIPS = {name: value for name, value in vars(Grip).items() if name.isupper()}
_INSTEAD = {Grip: namedtuple("Grip", _GRIPS)(**_GRIPS)}
"""Classes that numba does not know -> what stands for them in compiled code."""
_WIDTHS = {"b": np.bool_, "i": np.int64, "f": np.float64}
"""Kind of a number, as numpy names it -> its type in a record."""
_OF_THE_COMPILER = re.compile(r"Failed in |During: |Enable logging |File |\s*$")
"""How lines of numba's messages begin that say nothing about the function."""


class StepError(ConfigError):
    """A `RobotPolicy` whose `step` cannot be compiled, or failed, or whose memory or parameters make no sense."""


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
            arguments, or memory or parameters that are no numbers; in `reset`, a `step` that cannot be compiled; in
            `act`, one that raises.
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
            chance: (draws,) uniform random numbers in [0, 1), the only ones that the seed of a run reaches.
            known: What all robots know: the numbers of `SwarmSpec`, `known.arena_size_m[0]`, and the parameters.

        Returns:
            Left wheel, right wheel and gripper, in [-1, 1].
        """
        raise NotImplementedError

    def __init__(self, **parameters: Any) -> None:
        known_keys(parameters, self.parameters, f"parameter of {type(self).__name__}")
        cast = {}
        for name, value in parameters.items():
            given, default = np.asarray(value), np.asarray(self.parameters[name])
            kind = _WIDTHS[default.dtype.kind]
            if given.shape != default.shape or not np.can_cast(given.dtype, kind):
                raise StepError(
                    f"Expected parameter {name} to have the kind and shape of its default {shown(default.tolist())}, "
                    f"got {shown(value)}."
                )
            cast[name] = given.astype(kind)[()]
        self.parameters = {**self.parameters, **cast}

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        asked = tuple(inspect.signature(cls.step).parameters)
        if len(asked) != 4:
            raise StepError(
                f"Expected {cls.__name__}.step to take see, robot, chance and known, got {asked}; it has no self."
            )
        whole(f"draws of {cls.__name__}", cls.draws, at_least=0)
        _record(cls.memory, "memory")
        _record(cls.parameters, "parameters")
        taken = cls.parameters.keys() & {field.name for field in fields(SwarmSpec)}
        if taken:
            raise StepError(f"Expected parameters of other names than SwarmSpec's, got {min(taken)!r}.")

    def reset(self, spec: SwarmSpec, rng: np.random.Generator) -> None:
        """Start a run: every robot remembers what `memory` says."""
        robot, known = _record(self.memory, "memory"), _record(_numbers_of(spec) | dict(self.parameters), "parameters")
        self._types = (_see_type(spec.layout, getattr(self, "reads", None)), robot.dtype, known.dtype)
        self._carrying = spec.layout.part("carrying").start
        self._kernel  # noqa: B018 - it is compiled by being asked for
        robots = np.repeat(robot.view(np.uint8), spec.n_robots, axis=0)
        failed = np.full(2, -1, np.int64)
        seen, drawn = np.zeros((1, spec.layout.size), np.float32), np.zeros(self.draws)
        actions = np.zeros((spec.n_robots, COMMANDS), np.float32)
        before = robot.view(np.uint8)
        self._start(spec, rng, self.draws, known.view(np.uint8), robots, before, seen, drawn, failed, actions)

    @property
    def robots(self) -> np.ndarray:
        """(N,) records of what the robots remember, a copy: `policy.robots["name"]`."""
        return self._state[1].view(self._types[1])[:, 0].copy()

    @property
    def _kernel(self) -> Callable[..., None]:  # type: ignore[override] - made of the types of a run
        return _kernel_of(type(self).step, self._types, self._carrying)

    def check_ticks(self) -> None:
        """Raise what `step` has raised, found by asking it once more, in Python, with what it was given.

        Raises:
            StepError: names the policy, the exception, and where and when it was.
        """
        known, _, before, seen, drawn, failed, _ = self._state
        if failed[0] < 0:
            return
        see_type, robot_type, known_type = self._types
        given = seen.view(see_type)[0, 0], before.copy().view(robot_type)[0, 0], drawn, known.view(known_type)[0, 0]
        cause, step = None, type(self).step
        try:
            with np.errstate(divide="raise", invalid="raise"):
                told = shown(step(*given))
        except Exception as error:  # noqa: BLE001 - whatever it is, it is told
            file = step.__code__.co_filename
            lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
            cause, told = error, f"{type(error).__name__}: {error} (line {lines[-1]})"
        raise StepError(
            f"Expected {type(self).__name__}.step to return {ACTION}, got {told}, for robot_{failed[0]} in tick "
            f"{failed[1]}."
        ) from cause


@lru_cache(64)  # notebooks define classes again and again
def _kernel_of(step: Any, kinds: tuple[np.dtype[Any], ...], carrying: int) -> Callable[..., None]:
    """Return one tick of all robots by a step, compiled.

    Args:
        step: Of a policy.
        kinds: Types of what it sees, remembers and knows.
        carrying: Column of the observation that tells whether a robot carries an object.
    """
    see_type, robot_type, known_type = kinds
    function = _compiled(step, {}) if is_compiled(njit(step)) else step
    if function is not step:
        see, robot, known = (np.zeros(1, kind)[0] for kind in kinds)
        _check_compiles(function, tuple(map(type_of, (see, robot, np.zeros(0), known))))

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

    return kernel_of_process(step_all)


def _compiled(function: Any, done: dict[Any, Any]) -> Any:
    """Return a function, and those that it calls by their names, to be compiled. As in Python, wrong indices raise."""
    if function not in done:
        names = dict(function.__globals__)
        copy = FunctionType(function.__code__, names, function.__name__, function.__defaults__, function.__closure__)
        done[function] = njit(error_model="python", boundscheck=True)(copy)
        for name in function.__code__.co_names:
            value = names.get(name)
            if isinstance(value, FunctionType):
                names[name] = _compiled(value, done)
            elif isinstance(value, type) and value in _INSTEAD:
                names[name] = _INSTEAD[value]
    return done[function]


def _check_compiles(function: Any, kinds: tuple[Any, ...]) -> None:
    """Compile a step for arguments of these types; raises StepError if numba cannot, or for another result."""
    name, code = function.py_func.__qualname__, function.py_func.__code__
    try:
        function.compile(kinds)
    except Exception as error:  # numba has errors of many kinds; of an unknown field of a record it raises KeyError
        said = [line.strip() for line in str(error).splitlines() if not _OF_THE_COMPILER.match(line)]
        lines = re.findall(r'File ".*", line (\d+)', str(error))
        if isinstance(error, KeyError):
            said = [f"no field {error.args[0]!r}"]
            lines = [step.positions.lineno for step in dis.get_instructions(code)
                     if step.argval == error.args[0] and step.positions is not None]  # fmt: skip
        raise StepError(
            f"Expected {name} to be Python that numba compiles (docs/policies.md, A fast one), got "
            f"{' '.join(said[:2])} (line {(lines or [code.co_firstlineno])[0]})."
        ) from error
    result: Any = function.overloads[kinds].signature.return_type
    parts: Any = result if isinstance(result, types.BaseTuple) else ()
    if len(parts) != COMMANDS or not all(isinstance(p, types.Integer | types.Float | types.Boolean) for p in parts):
        raise StepError(
            f"Expected {name} (line {code.co_firstlineno}) to return {ACTION}, got {types.unliteral(result)}."
        )


def _see_type(layout: ObservationLayout, reads: tuple[str, ...] | None) -> np.dtype[Any]:
    """Return the type of one observation as a record of the slices that are read."""
    wanted = None if reads is None else {*reads} | ({"light"} if LIGHT_IF_CARRYING in reads else set())
    parts = [part for part in layout if wanted is None or part.name in wanted]
    described: Any = {
        "names": [part.name for part in parts],
        "formats": [(np.float32, (part.size,) if part.size > 1 else ()) for part in parts],
        "offsets": [part.start * 4 for part in parts],
        "itemsize": layout.size * 4,
    }
    return np.dtype((np.record, described))


def _record(values: Mapping[str, Any], what: str) -> np.ndarray:
    """Return (1, 1) a record of values; raises StepError for a name no attribute can have, or what is no number."""
    arrays = {name: np.asarray(value) for name, value in values.items()}
    for name, array in arrays.items():
        if not name.isidentifier() or hasattr(np.record, name) or array.dtype.kind not in _WIDTHS:
            raise StepError(
                f"Expected the {what} to be numbers, or True or False, under names that numpy's records leave free, "
                f"got {name!r}: {shown(values[name])}."
            )
    described = [(name, _WIDTHS[array.dtype.kind], array.shape) for name, array in arrays.items()]
    kind = np.dtype((np.record, np.dtype(described or [("nothing", np.bool_)], align=True)))
    record = np.zeros((1, 1), kind)
    for name, array in arrays.items():
        record[name] = array
    return record


def _numbers_of(spec: SwarmSpec) -> dict[str, Any]:
    """Return the fields of a specification that are numbers."""
    found = {field.name: getattr(spec, field.name) for field in fields(spec)}
    return {name: value for name, value in found.items() if isinstance(value, bool | int | float | tuple)}
