"""Plain values of files become the types of the code, or are refused by the name of the field."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.typed import Amount, Count, Name, Within, check_array, typed


@dataclass(frozen=True, kw_only=True)
class Part:
    name: Name
    sizes: Annotated[tuple[Count, ...], Within(at_least=1, at_most=3)] = (1,)
    place: tuple[float, float] | None = None


@dataclass(frozen=True, kw_only=True)
class Whole:
    parts: tuple[Part, ...]
    amount: Amount = 0.0
    is_new: bool = False
    versions: Mapping[str, str] | None = None
    more: Any = None


def test_tables_become_dataclasses_and_lists_tuples():
    given = {"parts": [{"name": "a", "sizes": [1, 2], "place": [0, -1.5]}], "versions": {"numpy": "2"}, "more": [None]}
    part = Part(name="a", sizes=(1, 2), place=(0, -1.5))
    assert typed(Whole, given, "") == Whole(parts=(part,), versions={"numpy": "2"}, more=[None])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"colour": 1}, "Unknown key 'colour'"),
        ({"parts": [{}]}, r"Missing key 'parts\[0\].name'"),
        ({"parts": [{"name": "a", "colour": 1}]}, r"Unknown key 'parts\[0\].colour'"),
        ({"parts": {}}, "Expected parts to be a list, got {}"),
        ({"parts": [[]]}, r"Expected parts\[0\] to be a table"),
        ({"parts": [{"name": ""}]}, r"Expected parts\[0\].name to be a non-empty text"),
        ({"parts": [{"name": "a", "sizes": []}]}, "sizes to have 1 to 3, got 0"),
        ({"parts": [{"name": "a", "sizes": [1] * 4}]}, "sizes to have 1 to 3, got 4"),
        ({"parts": [{"name": "a", "sizes": [1, True]}]}, r"sizes\[1\] to be a whole number >= 0, got True"),
        ({"parts": [{"name": "a", "sizes": [10**30]}]}, "at most 1,000,000,000,000,000 in size"),
        ({"parts": [{"name": "a", "place": [1]}]}, "place to have 2 entries, got 1"),
        ({"amount": "x"}, "Expected amount to be a finite number >= 0, got 'x'"),
        ({"amount": None}, "Expected amount to be a finite number >= 0, got None"),
        ({"amount": float("nan")}, "Expected amount to be a finite number >= 0, got nan"),
        ({"is_new": 1}, "Expected is_new to be True or False"),
        ({"versions": {"numpy": 2}}, "Expected versions.numpy to be a text, got 2"),
        ({"versions": []}, "Expected versions to be a table"),
    ],
)
def test_what_is_of_another_type_or_out_of_bounds_is_named(change, message):
    with pytest.raises(ConfigError, match=message):
        typed(Whole, {"parts": []} | change, "")


def test_one_of_several_types():
    for value in (True, 1, 0.5, "a"):
        assert typed(float | str | bool, value, "a") is value
    for value in (None, [1], {}):
        with pytest.raises(ConfigError, match="Expected a to be one of a number, a text, True or False"):
            typed(float | str | bool, value, "a")
    with pytest.raises(ConfigError, match="Expected a to be one of a number, a text, got True"):
        typed(float | str, True, "a")


def test_arrays_are_of_one_type_and_shape():
    check_array("a", np.zeros((3, 2), np.float32), np.float32, (3, None))
    for given in (
        np.zeros((3, 2)),
        np.zeros((3, 2), ">f4"),
        np.zeros((3, 2), np.complex64),
        np.full((3, 2), "x"),
        np.zeros(3, np.float32),
        np.zeros((2, 2), np.float32),
    ):
        with pytest.raises(ConfigError, match=r"Expected a to be an array \(3, any\) of float32, got"):
            check_array("a", given, np.float32, (3, None))
    with pytest.raises(ConfigError, match="Expected a to hold finite numbers"):
        check_array("a", np.array([np.nan], np.float32), np.float32, (1,))
