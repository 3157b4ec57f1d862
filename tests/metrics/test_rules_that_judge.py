"""Each rule that judges claims: seldom wrong where nothing can be said, and able to say yes and no."""

import pytest

from tests.support.judged_rules import RULES, answers, share

N_WORLDS = 60
MOST_WRONG = 7 / N_WORLDS
"""Of 60 worlds in which one in twenty is wrong, more than seven are in one of a hundred."""


@pytest.mark.parametrize("name", RULES)
def test_a_rule_is_seldom_wrong(name):
    rule = RULES[name]
    assert share(answers(rule, "border", 6, N_WORLDS), rule.wrong) <= MOST_WRONG


@pytest.mark.parametrize("name", RULES)
def test_a_rule_can_say_yes_and_no(name):
    rule = RULES[name]
    assert set(answers(rule, "holds", 96, 4)) == {"supported"}
    assert set(answers(rule, "fails", 96, 4)) == {rule.failing}
