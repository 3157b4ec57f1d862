"""Slow twin of the scatter of cache sites: places as complex numbers, draws as an iterator."""

import cmath
from collections.abc import Callable, Iterator

FAR = {"inside": 0.005, "border": 0.05}
"""Share of sites that lie anywhere allowed: the midpoint is allowed, or the best place is on a border."""
SCALE_M = {"inside": 0.0125, "border": 0.03}
Box = tuple[float, float, float, float]


def random_shares(share: float) -> Iterator[float]:
    """Random numbers that follow from one: those of Park and Miller, as in the C++ engine `minstd_rand`."""
    state = 1 + int(share * (2**31 - 3))
    while True:
        yield state / (2**31 - 1)
        state = state * 48271 % (2**31 - 1)


def site(
    best: complex, where: str, box: Box, turn: float, draw: float, is_allowed: Callable[[complex], bool]
) -> complex:
    """Where the site lies: `turn` is the share of a full turn, `draw` decides how far; both in [0, 1)."""
    if draw < FAR[where]:
        low, high = complex(*box[:2]), complex(*box[2:])
        size = high - low
        along, across = random_shares(turn), random_shares(draw / FAR[where])
        tried = (low + complex(size.real * next(along), size.imag * next(across)) for _ in range(256))
        return next((place for place in tried if is_allowed(place)), best)
    rest = (draw - FAR[where]) / (1.0 - FAR[where])
    offset = cmath.rect(SCALE_M[where] / (1.0 - rest), cmath.tau * turn)
    tried = (best + offset * cmath.exp(2.4j * k) for k in range(16))
    return next((place for place in tried if is_allowed(place)), best)
