"""Declared types: what passes, what is converted, and what is refused by which message."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import numpy as np
import pytest
from msgspec import Meta

from swarm_forage_env._internal.fields import (
    Amount,
    Checked,
    ConfigError,
    Count,
    FileName,
    Name,
    Number,
    Positive,
    Share,
    Whole,
    checked,
    known_keys,
    known_name,
    read,
)

Place = tuple[Positive, Positive]


@pytest.mark.parametrize(
    ("kind", "value", "kept"),
    [
        (Number, -2, -2.0),
        (Number, np.float32(0.5), 0.5),
        (Amount, 0, 0.0),
        (Share, 1, 1.0),
        (Count, np.uint8(3), 3),
        (Whole, 10**15, 10**15),
        (bool, np.True_, True),
        (Name, "a \u200c b", "a \u200c b"),
        (FileName, "n" * 60, "n" * 60),
        (Place, [1, 2.5], (1.0, 2.5)),
        (Whole | None, None, None),
        (bool | int | float | str, 1, 1),
        (Literal["left", "right"], "left", "left"),
    ],
)
def test_values_become_what_is_declared(kind, value, kept):
    found = checked("box", value, kind)
    assert found == kept
    assert type(found) is type(kept)


@pytest.mark.parametrize(
    ("kind", "values", "wanted"),
    [
        (Number, (math.nan, -math.inf, 1e16, 10**400, None, "3", True, 1j, np.ones(1)), "to be a finite number"),
        (Positive, (0, -1.0, 1e-16), "to be a finite number > 0"),
        (Amount, (-1e-9,), "to be a finite number >= 0"),
        (Share, (1.1, -0.1, math.nan), "to be a number from 0 to 1"),
        (Count, (-1, 1.0, True, "1", None), "to be a whole number >= 0"),
        (Whole, (0, 10**15 + 1, 10**30), "to be a whole number >= 1"),
        (bool, (1, None, "yes"), "to be True or False"),
        (Name, ("", 3, "a\nb", "\x1b[0m", "\u202eb", "\ud800"), "to be a non-empty text without control characters"),
        (FileName, ("../x", "a/b", "a\\b", "C:x", ".a", "", "a\x00", "n" * 61, 7), "to be at most 60 characters"),
        (Place, ("ab", 4, {}), "to be a list"),
        (Place, ((1.0,), [1, 2, 3]), "to have 2 entries"),
        (Annotated[tuple[int, ...], Meta(min_length=1, max_length=2)], ((),), "to have at least 1"),
        (Annotated[tuple[int, ...], Meta(min_length=1, max_length=2)], ((1, 2, 3),), "to have at most 2"),
        (Mapping[str, int], ([], "a", None), "to be a table of values by name"),
        (float | bool, ("a", None, []), "to be a number or True or False"),
        (Literal["left", "right"], ("Lefd", ["left"], None), "to be one of left, right"),
    ],
)
def test_others_are_refused_by_their_name(kind, values, wanted):
    for value in values:
        with pytest.raises(ConfigError) as caught:
            checked("box", value, kind)
        assert str(caught.value).startswith(f"Expected box {wanted}")
        assert ", got " in str(caught.value)


@dataclass(frozen=True, kw_only=True, slots=True)
class Part(Checked):
    called: ClassVar[str] = "part"

    name: Name
    sizes: Annotated[tuple[Count, ...], Meta(min_length=1)] = (1,)
    least: Number = 0.0

    def check(self):
        if min(self.sizes) < self.least:
            raise ConfigError("too small")


@dataclass(frozen=True, kw_only=True, slots=True)
class Box(Checked):
    parts: tuple[Part, ...]
    lid: Part | Amount = 0.0


def test_constructors_check_and_convert():
    part = Part(name="a", sizes=[1, 2], least=1)
    assert part == Part(name="a", sizes=(1, 2), least=1.0)
    assert hash(part) == hash(replace(part, least=1))
    with pytest.raises(ConfigError, match=r"^Expected part\.sizes\[1\] to be a whole number >= 0, got -2\.$"):
        replace(part, sizes=(1, -2))
    with pytest.raises(ConfigError, match="too small"):
        replace(part, least=5)


def test_tables_become_dataclasses():
    assert read(Box, {"parts": [{"name": "a"}], "lid": {"name": "b"}}) == Box(
        parts=(Part(name="a"),), lid=Part(name="b")
    )
    assert read(Box, {"parts": [], "lid": 1}).lid == 1.0


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ([], "Expected box to be a table"),
        ({}, r"Missing key 'box\.parts'\."),
        ({"parts": [], "lids": 1}, r"Unknown key 'box\.lids'\. Did you mean 'box\.lid'\?"),
        ({"parts": [{}]}, r"Missing key 'box\.parts\[0\]\.name'"),
        ({"parts": [[]]}, r"Expected box\.parts\[0\] to be a Part, got \[\]"),
        (
            {"parts": [{"name": "a", "sizes": [1, True]}]},
            r"box\.parts\[0\]\.sizes\[1\] to be a whole number >= 0, got True",
        ),
        ({"parts": [], "lid": {"name": ""}}, r"box\.lid\.name to be a non-empty text"),
        ({"parts": [], "lid": "x"}, "box.lid to be a Part or a finite number >= 0, got 'x'"),
    ],
)
def test_what_is_wrong_in_a_table_is_named_by_its_path(given, message):
    with pytest.raises(ConfigError, match=message):
        read(Box, given, "box")


def test_unknown_names_are_refused_with_the_nearest():
    known_keys({"side": 1}, ("side", "top"))
    with pytest.raises(TypeError, match=r"^Unknown option 'box\.sied'\. Did you mean 'box\.side'\?$"):
        known_keys({"top": 1, "sied": 1}, ("side", "top"), "option", prefix="box.")
    with pytest.raises(ConfigError, match=r"^Unknown side 'lefd'\. Did you mean 'left'\? Known: left, right\.$"):
        known_name("side", "lefd", ("left", "right"))
    with pytest.raises(ConfigError, match=r"Near it: left, loft\. All 3: list sides\."):
        known_name("side", "leftt", ("left", "loft", "top"), all_by="list sides")
