"""The names of mixed swarms: which policies there are, and how many robots each of them drives.

    mixed:ppo_warehouse_small=10,crw=40            ten robots and forty; 50 robots are in the swarm
    mixed:ppo_warehouse_small=10,crw=rest          ten, and all others
    mixed:ppo_warehouse_small=20%,crw=rest         a fifth, the same as 0.2; fits every size of the swarm
    mixed:ppo_warehouse_small=share,crw=rest       as many as the parameter `share` says, for studies
    mixed:my_module.py:MyPolicy=10,crw=rest        a class in a Python file, see `registry.split_class`
    mixed:model.zip:decision_ticks=5=10,crw=rest   a file that is told its interface, see `registry.split_interface`

Parts take the rows of the swarm in their order: above, robots 0 to 9 are driven by the trained policy.
"""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from math import floor
from typing import Any

import numpy as np

from swarm_forage_env._internal.fields import ConfigError, number

PREFIX = "mixed:"
REST, SHARE = "rest", "share"
"""Words for an amount: all robots that are left; as the parameter of that name says."""

_CLASS = r"(?:(?<=\.py):[^\W\d]\w*)?"
_INTERFACE = r"(?::[a-z_]+=[^,=]+(?:,[a-z_]+=[^,=]+)*)?"
_AMOUNT = rf"\d+%?|\d*\.\d+%?|{REST}|{SHARE}"
_PART = rf"(?P<policy>[^,:]+?{_CLASS}{_INTERFACE})=(?P<amount>{_AMOUNT})(?=,|$)"
_PART_WORDS = re.compile(_PART)
_UNNAMED = re.sub(r"\?P<\w+>", "?:", _PART)
_LEADING = re.compile(rf"{PREFIX}{_UNNAMED}(?:,{_UNNAMED})*")


@dataclass(frozen=True, slots=True)
class Part:
    """Robots of a mixed swarm that one policy drives."""

    policy: str
    """Registered name, or path of a policy file, as in any place that names a policy."""
    amount: str
    """A whole number of robots, a share with a decimal point, `REST` or `SHARE`."""

    @property
    def share(self) -> Fraction | None:
        """The share of the swarm, exactly as written; None for another kind of amount."""
        return Fraction(self.amount) if "." in self.amount else None


def is_mixture(policy: str) -> bool:
    """Return whether a policy is a mixed swarm."""
    return policy.startswith(PREFIX)


def leading_mixture(text: str) -> str:
    """Return the mixed swarm that a list of policies, separated by commas, begins with; "" if there is none."""
    found = _LEADING.match(text)
    return "" if found is None else found[0]


def policies_in_mixtures(text: str) -> list[str]:
    """Return the policies of all mixed swarms that occur in a text, such as a word of a command line."""
    return [
        part["policy"] for found in _LEADING.finditer(text) for part in _PART_WORDS.finditer(found[0][len(PREFIX) :])
    ]


@lru_cache(maxsize=256)  # every run of a study asks
def mixture_parts(policy: str) -> tuple[Part, ...]:
    """Return the parts of a mixed swarm.

    Raises:
        ConfigError: a part that is not POLICY=AMOUNT, is a mixed swarm itself, or amounts that cannot be together.
    """
    text, place, parts = policy.removeprefix(PREFIX), 0, []
    while place <= len(text):
        found = _PART_WORDS.match(text, place)
        if found is None:
            raise ConfigError(
                f"Expected a mixed swarm as {PREFIX}POLICY=AMOUNT,POLICY=AMOUNT with a number of robots (10), a share "
                f"(0.2 or 20%) or the word {REST}, got {text[place:]!r} in {policy!r}."
            )
        parts.append(Part(found["policy"], _plain(found["amount"])))
        place = found.end() + 1
    nested = [part.policy for part in parts if is_mixture(part.policy)]
    if nested:
        raise ConfigError(f"Expected policies as parts of {policy!r}, got the mixed swarm {nested[0]!r}.")
    amounts = [part.amount for part in parts]
    for word in (REST, SHARE):
        if amounts.count(word) > 1:
            raise ConfigError(f"Expected {word!r} once in {policy!r}, got it {amounts.count(word)} times.")
    total = sum(part.share or 0 for part in parts)
    if total > 1 or (total < 1 and all(part.share is not None for part in parts)):
        raise ConfigError(
            f"Expected shares of {policy!r} that add up to 1, got {float(total):g}; write one of them as {REST}."
        )
    return tuple(parts)


def _plain(amount: str) -> str:
    """Return an amount as it is stored: 20% and .20 are 0.2."""
    if amount.endswith("%"):
        return _decimal(Fraction(amount[:-1]) / 100)
    return _decimal(Fraction(amount)) if "." in amount else amount if amount in (REST, SHARE) else str(int(amount))


def _decimal(share: Fraction) -> str:
    """Return a share with a decimal point and without an exponent."""
    return np.format_float_positional(float(share), trim="0")


def has_open_share(policy: str) -> bool:
    """Return whether a policy is a mixed swarm that needs the parameter `SHARE`."""
    return is_mixture(policy) and any(part.amount == SHARE for part in mixture_parts(policy))


def mixture_of(parts: Sequence[Part]) -> str:
    """Return the name of a mixed swarm of these parts."""
    return PREFIX + ",".join(f"{part.policy}={part.amount}" for part in parts)


def part_sizes(policy: str, n_robots: int, share: Any = None) -> tuple[int, ...]:
    """Return how many robots each part of a mixed swarm has.

    A share of 0.25 of 10 robots is 2.5 robots. Borders between shares are rounded, halves upwards: two shares of 0.25
    and a rest get 3, 2 and 5 robots. So no part is a whole robot away from its share, and shares of 1 together are the
    whole swarm. A part may have no robot.

    Args:
        policy: The mixed swarm.
        n_robots: Size of the swarm.
        share: Share of the part whose amount is `SHARE`; None where there is none.

    Raises:
        ConfigError: counts that do not add up to the swarm, or no share where one is needed, or one where none is.
    """
    parts = mixture_parts(policy)
    is_open = has_open_share(policy)
    if is_open != (share is not None):
        wanted = f"the parameter {SHARE} for" if is_open else f"no parameter {SHARE} for"
        raise ConfigError(f"Expected {wanted} {policy!r}, got {share!r}; it says how much a part POLICY={SHARE} gets.")
    if is_open:
        number("share", share, at_least=0.0, at_most=1.0)
    sizes: list[int] = []
    so_far, border = Fraction(0), 0
    for part in parts:
        wanted_share = Fraction(str(float(share))) if part.amount == SHARE else part.share
        if wanted_share is None:
            sizes.append(0 if part.amount == REST else int(part.amount))
            continue
        so_far += wanted_share
        sizes.append(floor(so_far * n_robots + Fraction(1, 2)) - border)
        border += sizes[-1]
    left = n_robots - sum(sizes)
    rest = next((place for place, part in enumerate(parts) if part.amount == REST), None)
    if left < 0 or (left and rest is None):
        told = " + ".join(map(str, (size for place, size in enumerate(sizes) if place != rest)))
        hint = "" if left < 0 else f"; write one of them as {REST}"
        raise ConfigError(
            f"Expected parts of {policy!r} that {'fit into' if rest is not None else 'add up to'} a swarm of "
            f"{n_robots} robots, got {told} = {n_robots - left}{hint}. Shares such as 0.2 fit every size."
        )
    if rest is not None:
        sizes[rest] = left
    return tuple(sizes)


def different_labels(labels: Sequence[str]) -> tuple[str, ...]:
    """Return labels of parts; of equal ones each says which part it is."""
    counts = Counter(labels)
    return tuple(
        f"{label} (part {place})" if counts[label] > 1 else label for place, label in enumerate(labels, start=1)
    )
