"""Waveforms: their formulas, their samples in the study, their conversion from and to plain values."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

import metrics
from swarm_forage_env.wrappers.throttle import IDEAL_THROTTLE, ThrottleConfig, sine_throttles, square_throttles
from swarm_forage_env.wrappers.waveform import Waveform

DT_S = 0.2
SAMPLES = range(1_000, 50_001, 1_000)
"""Ticks at the ends of the study's recording intervals."""


def sampled(waveform: Waveform, ticks=SAMPLES) -> list[float]:
    signal = waveform.signal(DT_S)
    return [signal(tick) for tick in ticks]


# The study


@pytest.mark.parametrize(
    ("throttles", "distances"),
    [
        (square_throttles(), [7.4, 9.8, 12.2, 14.6, 17.0, 19.4]),
        (sine_throttles(), [5.04, 7.18, 9.44, 11.76, 14.13, 16.52, 18.92]),
    ],
    ids=["square", "sine"],
)
def test_distances_from_ideal_conditions_are_those_of_the_study(throttles, distances):
    ideal, *levels = throttles
    assert set(sampled(ideal.waveform)) == {IDEAL_THROTTLE}
    measured = [sum(abs(value - IDEAL_THROTTLE) for value in sampled(level.waveform)) for level in levels]
    assert measured == pytest.approx(distances, abs=0.0051)


# Formulas


def test_values_at_chosen_ticks():
    period_s = 100 * DT_S
    sine = Waveform(kind="sine", amplitude=0.3, offset=0.5, period_s=period_s)
    assert sampled(sine, [0, 25, 75]) == pytest.approx([0.5, 0.8, 0.2])
    square = Waveform(kind="square", amplitude=0.3, offset=0.5, period_s=period_s)
    assert sampled(square, [0, 1, 49, 51, 99, 101]) == [0.8, 0.8, 0.8, 0.2, 0.2, 0.8]
    sawtooth = Waveform(kind="sawtooth", amplitude=0.3, offset=0.5, period_s=period_s)
    assert sampled(sawtooth, [0, 25, 49, 50, 75, 100]) == pytest.approx([0.5, 0.65, 0.794, 0.2, 0.35, 0.5])
    constant = Waveform(kind="constant", amplitude=0.3)
    assert sampled(constant, [0, 1, 10**6]) == [0.3, 0.3, 0.3]
    down = Waveform(kind="step", amplitude=-0.4, offset=0.4, start_s=10.0)
    assert sampled(down, [1, 49, 50, 51]) == [0.4, 0.4, 0.0, 0.0]
    table = Waveform(kind="table", times_s=(2.0, 4.0, 4.2), values=(0.0, 1.0, 0.5))
    assert sampled(table, [0, 10, 15, 20, 21, 99]) == pytest.approx([0.0, 0.0, 0.5, 1.0, 0.5, 0.5])


@pytest.mark.parametrize("start_s", [0.6, 3 * DT_S])  # 3 * 0.2 / 0.2 is more than 3
def test_a_step_happens_at_the_tick_of_its_time(start_s):
    signal = Waveform(kind="step", amplitude=1.0, start_s=start_s).signal(DT_S)
    tick = round(start_s / DT_S)
    assert [signal(tick - 1), signal(tick)] == [0.0, 1.0]


@given(
    kind=st.sampled_from(["constant", "sine", "square", "sawtooth"]),
    amplitude=st.floats(-1, 1),
    offset=st.floats(-1, 1),
    period=st.floats(2.0, 1e5),
    phase=st.floats(-7, 7),
    tick=st.integers(0, 50_000),
)
def test_the_measures_know_the_same_waveforms(kind, amplitude, offset, period, phase, tick):
    shape = {} if kind == "constant" else {"offset": offset, "period_s": period * DT_S, "phase": phase}
    mine = Waveform(kind=kind, amplitude=amplitude, **shape).signal(DT_S)(tick)
    theirs = metrics.waveform(
        kind, tick, frequency=1.0 / period, amplitude=amplitude, offset=offset, phase=shape.get("phase", 0.0)
    )
    cycles = tick / period + (phase / math.tau if kind != "sawtooth" else 0.5)
    jumps_here = kind in ("square", "sawtooth") and abs(cycles * 2 - round(cycles * 2)) < 1e-6
    if not jumps_here:
        assert mine == pytest.approx(float(theirs), abs=1e-8)


EXAMPLES = {
    "constant": Waveform(kind="constant", amplitude=-0.2),
    "sine": Waveform(kind="sine", amplitude=-0.2, offset=0.1, period_s=7.0, phase=0.3),
    "square": Waveform(kind="square", amplitude=0.2, offset=0.1, period_s=7.0),
    "sawtooth": Waveform(kind="sawtooth", amplitude=-0.2, offset=0.1, period_s=7.0, phase=0.2),
    "step": Waveform(kind="step", amplitude=0.3, offset=0.1, start_s=3.0),
    "table": Waveform(kind="table", times_s=(0.0, 1.0, 9.0), values=(0.1, 0.7, -0.3)),
}


@pytest.mark.parametrize("kind", EXAMPLES)
def test_the_ends_are_the_nearest_bounds(kind):
    waveform = EXAMPLES[kind]
    values = sampled(waveform, range(1, 7 * 35 + 1))
    low, high = waveform.ends
    assert low - 1e-12 <= min(values) < low + 0.02
    assert high - 0.02 < max(values) <= high + 1e-12


# Plain values


def test_a_waveform_may_be_named_with_its_fields_beside_it():
    flat = {"waveform": "square", "amplitude": 0.2, "period_s": 5_000, "carriers": True}
    nested = {"waveform": {"kind": "square", "amplitude": 0.2, "period_s": 5_000}, "carriers": True}
    expected = ThrottleConfig(waveform=Waveform(kind="square", amplitude=0.2, period_s=5_000), carriers=True)
    assert ThrottleConfig.from_mapping(flat) == ThrottleConfig.from_mapping(nested) == expected
    assert flat["waveform"] == "square", "the given mapping is left alone"
