"""One check per kind of value: what passes, what is refused, and with which message."""

import math
from fractions import Fraction

import numpy as np
import pytest

from metrics import checks
from swarm_forage_env._internal import fields
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.wording import suggestion

HUGE = 10**400
"""Too large for a float."""


def refusal(check, *given, **limits) -> str:
    with pytest.raises(ConfigError) as caught:
        check("box.side", *given, **limits)
    return str(caught.value)


@pytest.mark.parametrize("value", [0, 2, -1.5, 1e15, np.float64(0.5)])
def test_numbers(value):
    fields.number("box.side", value)


@pytest.mark.parametrize("value", [1e300, -1e300, 10**20])
def test_numbers_of_which_nothing_can_be_computed_are_refused(value):
    assert (
        refusal(fields.number, value)
        == f"Expected box.side to be a finite number, at most 1e+15 in size, got {value!r}."
    )


def test_positive_numbers_are_no_closer_to_zero_than_can_be_divided_by():
    assert "a finite number > 0, no closer to 0 than 1e-15, got 1e-320" in refusal(fields.number, 1e-320, above=0.0)
    fields.number("box.side", 0.0, at_least=0.0)


def test_whole_numbers_stay_within_what_arrays_hold():
    assert "at most 1,000,000,000,000,000 in size" in refusal(fields.whole, 2**63, at_least=0)
    fields.whole("box.side", 2**63, at_least=0, at_most=2**63)


def test_messages_cut_what_is_too_long_to_read():
    assert refusal(fields.switch, [0] * 1000).endswith("... (3,000 characters).")
    assert "a value of type int that is too large to show" in refusal(fields.switch, 10**5000)


def test_texts_that_no_terminal_shows_are_refused():
    for name in ("\x1b[31m", "two\nlines", "\udcff", "\u202eright to left", "\u2066isolated"):
        assert "without control characters" in refusal(fields.text, name)


def test_texts_of_all_languages_are_taken():
    for name in ("\u0645\u06cc\u200c\u062e\u0648", "\u0915\u094d\u200d\u0937", "naïve", "群れ"):
        fields.text("box.name", name)


def test_the_most_seeds_are_one_number():
    assert fields.MOST_SEEDS == checks.MOST_SEEDS, "metrics import nothing from here, so each has its own"


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, None, "3", True, 1j, (1.0,), np.ones(1)])
def test_what_is_no_finite_number_is_refused(value):
    assert refusal(fields.number, value) == f"Expected box.side to be a finite number, got {value!r}."


def test_a_whole_number_too_large_for_a_float_is_refused():
    assert "a finite number, got 1000" in refusal(fields.number, HUGE)


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


@pytest.mark.parametrize(
    ("check", "value", "hint"),
    [
        (fields.whole, np.int64(5), "; convert it with int()."),
        (fields.number, np.float32(5), "; convert it with float()."),
        (fields.number, Fraction(1, 2), "; convert it with float()."),
        (fields.whole, np.float64(5), "got np.float64(5.0)."),
        (fields.number, np.bool_(True), "got np.True_."),
    ],
)
def test_numbers_of_other_kinds_are_refused_with_a_hint(check, value, hint):
    assert refusal(check, value).endswith(hint)


@pytest.mark.parametrize("value", [3, np.int64(3), np.uint8(3)])
def test_arguments_may_be_integers_of_numpy(value):
    taken = fields.as_whole("seed", value, at_least=3)
    assert taken == 3
    assert type(taken) is int


@pytest.mark.parametrize("value", [2, 3.0, "3", True, None, np.float64(3), np.bool_(True)])
def test_arguments_that_are_no_whole_numbers_are_refused(value):
    assert refusal(fields.as_whole, value, at_least=3).endswith(f"to be a whole number >= 3, got {value!r}.")
    assert "a whole number >= 3 or None, got" in refusal(fields.as_whole, value, at_least=3, or_none=True)


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


def test_a_table_is_returned_as_it_is():
    given = {"a": 1}
    assert fields.table("box", given) is given


def test_both_members_of_a_pair_are_positive_numbers():
    assert refusal(fields.pair, (1.0, 0.0)) == "Expected box.side[1] to be a finite number > 0, got 0.0."


@pytest.mark.parametrize("value", [(), [1.0], 1.0, "ab"])
def test_several_are_one_or_more_in_a_tuple(value):
    fields.several("box.side", (1.0,), "numbers")
    assert refusal(fields.several, value, "numbers") == f"Expected box.side to be one or more numbers, got {value!r}."


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


@pytest.mark.parametrize("name", ["sied", ["side"], None])
def test_unknown_names_are_refused_with_all_known_ones(name):
    fields.known_name("edge", "side", ("side", "top"))
    with pytest.raises(ConfigError) as caught:
        fields.known_name("edge", name, {"side": 1, "top": 2})
    assert str(caught.value).startswith(f"Unknown edge {name!r}.")
    assert str(caught.value).endswith(" Known: side, top.")


def test_suggestion_is_empty_when_nothing_is_near():
    assert suggestion("zzz", ["robots", "objects"]) == ""


@pytest.mark.parametrize(
    "name", ["../x", "/etc/x", "a/b", "a\\b", "C:x", ".hidden", "..", "a\nb", "a\x00", "n" * 61, "", 7]
)
def test_names_that_would_lead_files_elsewhere_are_refused(name):
    with pytest.raises(ConfigError, match="Expected the name to be"):
        fields.check_file_name("the name", name)


@pytest.mark.parametrize("name", ["warehouse_small", "S1a", "Große Halle 2.1", "倉庫", "n" * 60])
def test_ordinary_names_are_accepted(name, tmp_path):
    fields.check_file_name("the name", name)
    (tmp_path / f"{name}.parquet").touch()
    assert [file.stem for file in tmp_path.iterdir()] == [name]
