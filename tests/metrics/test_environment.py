"""Waveforms, the scaling of ideal performance, and the x axis of the flexibility figures."""

import math

import numpy as np
import pytest

from metrics import CurveError, environment_distance, environment_scaling, waveform

INTERVAL_ENDS = np.arange(1000, 50001, 1000)


def test_constant_ignores_everything_but_its_amplitude():
    signal = waveform("constant", [0, 1, 2], amplitude=0.1, offset=5.0, frequency=0.3, phase=1.0)
    assert signal.tolist() == [0.1, 0.1, 0.1]


def test_sine():
    signal = waveform("sine", [0, 1, 2, 3], frequency=0.25, amplitude=0.4, offset=0.5)
    assert signal == pytest.approx([0.5, 0.9, 0.5, 0.1], abs=1e-12)
    assert waveform("sine", 0, frequency=0.25, amplitude=0.4, phase=math.pi / 2) == pytest.approx(0.4, abs=1e-12)


def test_square_is_positive_at_zero():
    signal = waveform("square", [0, 1, 2.5, 3], frequency=0.25, amplitude=0.4, offset=0.4)
    assert signal.tolist() == [0.8, 0.8, 0.0, 0.0]


def test_sawtooth_phase_is_in_cycles():
    ticks = np.array([0.0, 1.0, 1.999, 2.0, 3.0])
    signal = waveform("sawtooth", ticks, frequency=0.25, amplitude=0.5, offset=0.1)
    assert signal == pytest.approx([0.1, 0.35, 0.1 + 0.49975, -0.4, -0.15], abs=1e-12)
    assert waveform("sawtooth", 0.0, amplitude=0.5, phase=0.25) == pytest.approx(0.25, abs=1e-12)


def test_steps_are_half_a_square_wave():
    before_and_after = [1, 49, 51, 99]
    down = waveform("square", before_and_after, frequency=1 / 100, amplitude=0.3)
    up = waveform("square", before_and_after, frequency=1 / 100, amplitude=0.3, offset=0.3, phase=math.pi)
    assert down.tolist() == [0.3, 0.3, -0.3, -0.3]
    assert up.tolist() == [0.0, 0.0, 0.6, 0.6]


@pytest.mark.parametrize(("kind", "period"), [("square", 25000), ("sine", 50000)])
def test_the_study_samples_agree_with_the_form_in_periods(kind, period):
    # The environment counts in periods; at multiples of half a period the sign hangs on the last bit.
    sine = np.sin(2 * math.pi * (INTERVAL_ENDS / period))
    shape = np.where(sine >= 0.0, 1.0, -1.0) if kind == "square" else sine
    signal = waveform(kind, INTERVAL_ENDS, frequency=1 / period, amplitude=0.3, offset=0.3)
    assert signal == pytest.approx(0.3 + 0.3 * shape, abs=1e-12)


def test_kinds_may_be_capitalised():
    assert waveform("Sine", 1, frequency=0.25, amplitude=1.0) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("parameters", [{"frequency": -1.0}, {"amplitude": math.nan}, {"offset": math.inf}])
def test_parameters_that_make_no_signal_are_refused(parameters):
    with pytest.raises(ValueError, match="finite numbers"):
        waveform("sine", [0, 1], **parameters)


@pytest.mark.parametrize(("model", "expected"), [("paper", 5.0), ("linear", 0.6), ("reciprocal", 0.2)])
def test_the_print_lets_the_best_swarm_gain_from_adversity(model, expected):
    value = environment_scaling(0.5, 0.1, model=model)
    assert value == pytest.approx(expected, abs=1e-12)
    assert np.shape(value) == ()


def test_linear_scaling_may_be_negative():
    assert environment_scaling([1.5, 0.2], 0.1) == pytest.approx([-0.4, 0.9], abs=1e-12)


def test_scalings_that_divide_by_zero_are_refused_with_advice():
    for ideal in (0.0, [0.1, 0.0]):
        with pytest.raises(CurveError, match="model='linear'"):
            environment_scaling([0.0, 0.5], ideal, model="paper")
    with pytest.raises(CurveError, match="model='linear'"):
        environment_scaling([0.5, 0.0], 0.1, model="reciprocal")


def test_signals_on_different_intervals_are_refused():
    with pytest.raises(CurveError, match="same intervals"):
        environment_scaling([0.1, 0.2], [0.1, 0.2, 0.3])
    with pytest.raises(CurveError, match="one sample per interval"):
        environment_distance([0.1, 0.2], [0.1, 0.2, 0.3])
    with pytest.raises(CurveError, match="one signal each"):
        environment_distance(np.ones((2, 3)), 0.1)


@pytest.mark.parametrize(
    ("kind", "frequency", "amplitudes", "published"),
    [
        ("square", 4e-5, [0.15, 0.20, 0.25, 0.30, 0.35, 0.40], [7.4, 9.8, 12.2, 14.6, 17.0, 19.4]),
        ("sine", 2e-5, [0.15, 0.20, 0.25, 0.30, 0.35, 0.40, 0.45], [5.04, 7.18, 9.44, 11.76, 14.13, 16.52, 18.92]),
    ],
)
def test_x_axis_of_the_flexibility_figures(kind, frequency, amplitudes, published):
    for amplitude, expected in zip(amplitudes, published, strict=True):
        applied = waveform(kind, INTERVAL_ENDS, frequency=frequency, amplitude=amplitude, offset=amplitude)
        distance = environment_distance(applied, 0.1)
        assert isinstance(distance, float)
        assert distance == pytest.approx(expected, abs=0.005)
        assert distance == pytest.approx(np.abs(applied - 0.1).sum(), abs=1e-9)


def test_ideal_conditions_are_at_zero():
    assert environment_distance(np.full(50, 0.1), 0.1) == 0.0
