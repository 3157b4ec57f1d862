"""One check per kind of value: what passes, what is refused, and with which message."""

import math

import numpy as np
import pytest

from swarm_forage_env._internal import fields
from swarm_forage_env._internal.fields import ConfigError


def refusal(check, *given, **limits) -> str:
    with pytest.raises(ConfigError) as caught:
        check("box.side", *given, **limits)
    return str(caught.value)


@pytest.mark.parametrize("value", [0, 2, -1.5, 1e15, np.float64(0.5)])
def test_numbers(value):
    fields.number("box.side", value)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, None, "3", True, 1j, (1.0,), np.ones(1)])
def test_what_is_no_finite_number_is_refused(value):
    assert refusal(fields.number, value) == f"Expected box.side to be a finite number, got {value!r}."


@pytest.mark.parametrize(
    ("limits", "inside", "outside", "wanted"),
    [
        ({"at_least": 0.5}, (0.5, 9), (0.49, math.nan), "a finite number >= 0.5"),
        ({"above": 0.5}, (0.51, 9), (0.5, -1), "a finite number > 0.5"),
        ({"at_most": 2}, (2, -9), (2.1, math.inf), "a finite number <= 2"),
        ({"below": 2}, (1.9, -9), (2, True), "a finite number < 2"),
        ({"at_least": 0, "at_most": 1}, (0, 1), (-0.1, 1.1), "a number in [0, 1]"),
        ({"above": 0, "at_most": 1}, (0.1, 1), (0, 1.1), "a number in (0, 1]"),
        ({"at_least": 0, "below": 1}, (0, 0.9), (-0.1, 1), "a number in [0, 1)"),
        ({"above": 0, "below": 1}, (0.1, 0.9), (0, 1), "a number in (0, 1)"),
    ],
)
def test_numbers_in_a_range(limits, inside, outside, wanted):
    for value in inside:
        fields.number("box.side", value, **limits)
    for value in outside:
        assert refusal(fields.number, value, **limits) == f"Expected box.side to be {wanted}, got {value!r}."


@pytest.mark.parametrize(
    ("limits", "inside", "outside", "wanted"),
    [
        ({}, (-3, 0, 10**15), (1.0, "1", None, True), "a whole number"),
        ({"at_least": 1}, (1, 5), (0, 1.5, None), "a whole number >= 1"),
        ({"at_most": 1}, (1, -5), (2, math.nan), "a whole number <= 1"),
        ({"at_least": 0, "at_most": 1000}, (0, 1000), (-1, 1001), "a whole number from 0 to 1,000"),
        ({"at_least": 1, "or_none": True}, (1, None), (0, False), "a whole number >= 1 or None"),
    ],
)
def test_whole_numbers(limits, inside, outside, wanted):
    for value in inside:
        fields.whole("box.side", value, **limits)
    for value in outside:
        assert refusal(fields.whole, value, **limits) == f"Expected box.side to be {wanted}, got {value!r}."


@pytest.mark.parametrize("value", [3, np.int64(3), np.uint8(3)])
def test_arguments_may_be_integers_of_numpy(value):
    taken = fields.as_whole("seed", value, at_least=3)
    assert taken == 3
    assert type(taken) is int


@pytest.mark.parametrize(
    ("check", "good", "bad", "wanted"),
    [
        (fields.switch, (True, False), (1, None, "yes", np.bool_(True)), "True or False"),
        (fields.text, ("a",), ("", 3, None), "a non-empty text without control characters"),
        (fields.pair, ((1.0, 2),), ((1.0,), (1.0, 2.0, 3.0), [1.0, 2.0], 4, "ab"), "(x, y)"),
        (
            fields.shares,
            ((1.0,), (0.5, 0.2, 0.3)),
            ((), (0.5, 0.4), (1.5, -0.5), [1.0], 1.0, (True,), (math.nan,), ("1",)),
            "positive shares that sum to 1",
        ),
        (fields.table, ({}, {"a": 1}), ([], "a", None), "a table of values by name"),
    ],
    ids=["switch", "text", "pair", "shares", "table"],
)
def test_other_values(check, good, bad, wanted):
    for value in good:
        check("box.side", value)
    for value in bad:
        assert refusal(check, value) == f"Expected box.side to be {wanted}, got {value!r}."


def test_one_of_a_few_words():
    fields.one_of("box.side", "left", ("left", "right"))
    expected = "Expected box.side to be one of left, right, got 'Lefd'. Did you mean 'left'?"
    assert refusal(fields.one_of, "Lefd", ("left", "right")) == expected
    assert refusal(fields.one_of, ["left"], {"left": 1}).startswith(
        "Expected box.side to be one of left, got ['left']."
    )


def test_instances():
    fields.instance("box.side", 3, int)
    assert refusal(fields.instance, 3, str) == "Expected box.side to be a str, got 3."
    expected = "Expected box.side to be an Exception, got 3; raise one."
    assert refusal(fields.instance, 3, type("Exception", (), {}), hint="; raise one") == expected


def test_unknown_keys_are_refused_with_the_nearest():
    fields.known_keys({"side": 1}, ("side", "top"))
    with pytest.raises(ConfigError, match=r"^Unknown key 'box\.sied'\. Did you mean 'side'\?$"):
        fields.known_keys({"top": 1, "sied": 1}, ("side", "top"), prefix="box.")
    with pytest.raises(ConfigError, match=r"^Unknown option '3'\.$"):
        fields.known_keys({3: 1}, {"side": 1}, "option")


@pytest.mark.parametrize(
    "name", ["../x", "/etc/x", "a/b", "a\\b", "C:x", ".hidden", "..", "a\nb", "a\x00", "n" * 61, "", 7]
)
def test_names_that_would_lead_files_elsewhere_are_refused(name):
    with pytest.raises(ConfigError, match="Expected the name to be"):
        fields.check_file_name("the name", name)
