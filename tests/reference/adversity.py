"""Slow twins of throttle, noise and population dynamics: one robot, one column, one tick at a time."""

import math
from collections import deque
from collections.abc import Iterator

import numpy as np

from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.world.kernels.disturbances import standard
from swarm_forage_env.wrappers.population_process import EventRates
from tests.reference.motion import limited_wheels


def throttle_gain(command: tuple[float, float], strength: float) -> float:
    """Factor on both wheels of a robot with this command in [-1, 1]."""
    left, right = limited_wheels(*command)
    if left == 0.0 and right == 0.0:
        return 1.0
    return 1.0 - max(0.0, strength) * abs(left + right) / (abs(left) + abs(right))


def xoshiro128_plus(state: list[int]) -> Iterator[int]:
    """Numbers of 32 bits, as Blackman and Vigna publish the generator."""
    a, b, c, d = state
    while True:
        yield (a + d) % 2**32
        shifted = (b << 9) % 2**32
        c ^= a
        d ^= b
        b ^= c
        a ^= d
        c ^= shifted
        d = (d << 11) % 2**32 | d >> 21


def noise_bits(seed: int, stream: Stream, n_robots: int, n_columns: int) -> Iterator[np.ndarray]:
    """The bits of each tick, (n_robots, n_columns): number by number from 64 generators in turn."""
    columns = stream_rng(seed, stream).integers(2**32, size=(4, 64), dtype=np.uint32).T
    generators = [xoshiro128_plus(column) for column in columns.tolist()]
    while True:
        size = n_robots * n_columns
        numbers = [next(generator) for _ in range(-(-size // 64)) for generator in generators]
        yield np.array(numbers[:size], np.uint32).reshape(n_robots, n_columns)


def normal_of(uniform: np.ndarray) -> np.ndarray:
    """Standard normal numbers of uniform ones, which are multiples of 2^-24."""
    return normal_of_bits((np.asarray(uniform, np.float64) * 2.0**32).astype(np.uint32))


def normal_of_bits(bits: np.ndarray) -> np.ndarray:
    """Standard normal numbers of random bits."""
    return np.array([standard(each) for each in bits.ravel()], np.float32).reshape(bits.shape)


SENSORS = {"proximity": 24, "light": 24, "ground": 4, "wheel_speed": 2, "position": 2, "heading": 1}
"""Group of sensors -> numbers that are drawn for it."""


def noisy_row(
    row: list[float], draws: list[float], sigmas: dict[str, float], size_m: tuple[float, float]
) -> list[float]:
    """One observation row with Gaussian noise on the groups that have a standard deviation."""
    units = {"wheel_speed": [0.01 / 0.20] * 2, "position": [2.0 / size_m[0], 2.0 / size_m[1]]}
    noisy, start, draw = list(row), 0, iter(draws)
    for group, size in SENSORS.items():
        if group == "heading" and group in sigmas:
            angle = math.atan2(row[57], row[56]) + sigmas[group] * next(draw)
            noisy[56:58] = math.cos(angle), math.sin(angle)
        elif group in sigmas:
            low = -1.0 if group in units else 0.0
            for k, unit in enumerate(units.get(group, [1.0] * size), start):
                noisy[k] = min(1.0, max(low, row[k] + sigmas[group] * next(draw) * unit))
        start += size
    return noisy


class SlowPopulation:
    """The four processes, asked in every single tick; draws what the fast one draws."""

    def __init__(self, rates: EventRates, n_robots: int, seed: int, *, initial: int, most: int) -> None:
        self.rates = {name: getattr(rates, name) for name in ("death", "birth", "malfunction", "repair")}
        streams = stream_rng(seed, Stream.POPULATION, self.rates.values()).spawn(8)
        self.times = dict(zip(self.rates, streams[0::2], strict=True))
        self.choices = dict(zip(self.rates, streams[1::2], strict=True))
        self.n_robots, self.most = n_robots, most
        self.at_work = set(range(initial))
        self.in_repair: deque[int] = deque()
        self.n_born, self.dead = initial, set[int]()
        self.due = {name: self.wait(name) for name in self.rates}

    def wait(self, name: str) -> float:
        rate = self.rates[name]
        return math.inf if rate == 0.0 else math.floor(self.times[name].exponential() / rate)

    def happen(self, name: str, tick: int) -> None:
        self.due[name] = tick + self.wait(name)

    def luckiest(self, name: str, rows: set[int]) -> int:
        lots = self.choices[name].random(self.n_robots)
        return max(rows, key=lambda row: lots[row])

    def tick(self, tick: int) -> None:
        present = self.at_work | set(self.in_repair)
        if tick >= self.due["death"] and present:
            victim = self.luckiest("death", present)
            self.at_work.discard(victim)
            if victim in self.in_repair:
                self.in_repair.remove(victim)
            self.dead.add(victim)
            self.happen("death", tick)
        if (
            tick >= self.due["birth"]
            and self.n_born < self.n_robots
            and len(self.at_work) + len(self.in_repair) < self.most
        ):
            self.at_work.add(self.n_born)
            self.n_born += 1
            self.happen("birth", tick)
        if tick >= self.due["malfunction"] and self.at_work:
            victim = self.luckiest("malfunction", self.at_work)
            self.at_work.remove(victim)
            self.in_repair.append(victim)
            self.happen("malfunction", tick)
        if tick >= self.due["repair"]:
            if self.in_repair:
                self.at_work.add(self.in_repair.popleft())
            self.happen("repair", tick)
