"""Painting: shapes cover what they should, as their slow twin says, and canvases come back clean."""

import numpy as np
import pytest

from swarm_forage_env.rendering.paint import (
    Canvas,
    paint_box,
    paint_discs,
    paint_needles,
    paint_rings,
    paint_squares,
    plain,
)
from tests.reference.painting import painted, round_share, square_share

RED, GROUND = (250, 30, 10), (24, 31, 42)


def blank(size: int = 40) -> Canvas:
    return Canvas(plain(size, size, (0, 0, 0)))


@pytest.mark.parametrize("centre", [(20.0, 20.0), (20.5, 20.5), (20.3, 19.8)])
@pytest.mark.parametrize(
    ("paint", "area"),
    [
        (lambda canvas, centre: paint_discs(canvas, centre, 5.0, (255, 0, 0)), np.pi * 25.0),
        (lambda canvas, centre: paint_rings(canvas, centre, 8.0, 2.0, (255, 0, 0)), 2.0 * np.pi * 8.0 * 2.0),
        (lambda canvas, centre: paint_squares(canvas, centre, 3.4, (255, 0, 0)), 3.4**2),
        (
            lambda canvas, centre: paint_needles(canvas, centre, np.array([[0.6, -0.8]]), 9.0, 2.0, (255, 0, 0)),
            9.0 * 2.0 + np.pi,
        ),
    ],
    ids=["disc", "ring", "square", "needle"],
)
def test_shapes_cover_their_area_wherever_they_are(paint, area, centre):
    canvas = blank()
    paint(canvas, [centre])
    assert canvas.colours[..., 0].sum() / 255.0 == pytest.approx(area, rel=0.03)
    assert not canvas.colours[..., 1:].any()


def test_shapes_may_stick_out_of_the_canvas_or_be_absent():
    canvas = blank(10)
    paint_discs(canvas, [(0.0, 5.0), (-30.0, 4.0), (5.0, 100.0)], 3.0, (255, 0, 0))
    assert canvas.colours[5, 0, 0] == pytest.approx(255.0)
    assert not canvas.colours[:, 4:].any()
    before = canvas.colours.copy()
    paint_discs(canvas, np.empty((0, 2)), 3.0, (0, 255, 0))
    paint_box(canvas, (20.0, 0.0, 30.0, 5.0), (0, 255, 0))
    np.testing.assert_array_equal(canvas.colours, before)


# Against the twin

PLACES = np.random.default_rng(7).uniform(-4.0, 24.0, (9, 2))
"""Some stick out of a canvas of 20 x 16 pixels."""
ANGLES = np.linspace(0.1, 6.0, 9)
AHEAD = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
STRENGTH = np.linspace(0.2, 1.0, 9)


def as_painted(paint) -> np.ndarray:
    canvas = Canvas(plain(16, 20, GROUND))
    paint(canvas)
    return canvas.colours


@pytest.mark.parametrize(
    ("paint", "half_length", "radius", "reach", "strength"),
    [
        (lambda canvas: paint_discs(canvas, PLACES, 3.1, RED, STRENGTH), 0.0, 0.0, 3.6, STRENGTH),
        (lambda canvas: paint_discs(canvas, PLACES, 0.3, RED), 0.0, 0.0, 0.8, np.ones(9)),
        (lambda canvas: paint_rings(canvas, PLACES, 4.2, 1.4, RED), 0.0, 4.2, 1.2, np.ones(9)),
        (lambda canvas: paint_needles(canvas, PLACES - 3.0 * AHEAD, AHEAD, 6.0, 1.2, RED), 3.0, 0.0, 1.1, np.ones(9)),
    ],
    ids=["discs", "dots", "rings", "needles"],
)
def test_round_shapes_cover_what_their_twin_says(paint, half_length, radius, reach, strength):
    def share_of(row):
        return lambda x, y: strength[row] * round_share(x, y, PLACES[row], AHEAD[row], half_length, radius, reach)

    expected = painted(plain(16, 20, GROUND), RED, [share_of(row) for row in range(9)])
    np.testing.assert_allclose(as_painted(paint), expected, atol=1e-3)


def test_squares_cover_what_their_twin_says():
    expected = painted(
        plain(16, 20, GROUND), RED, [lambda x, y, at=at: 0.6 * square_share(x, y, at, 1.7) for at in PLACES]
    )
    found = as_painted(lambda canvas: paint_squares(canvas, PLACES, 3.4, RED, 0.6))
    np.testing.assert_allclose(found, expected, atol=1e-3)


def test_places_that_are_none_are_not_painted():
    canvas = blank()
    nowhere = [(np.nan, 5.0), (5.0, np.inf), (-1e300, 5.0)]
    paint_discs(canvas, nowhere, 3.0, RED)
    paint_squares(canvas, nowhere, 3.0, RED)
    assert not canvas.colours.any()


# Canvases


def test_a_picture_rounds_and_leaves_the_ground():
    ground = plain(16, 20, GROUND)
    canvas = Canvas(ground)
    paint_box(canvas, (2.0, 3.0, 10.5, 8.25), RED, 0.5)
    paint_discs(canvas, PLACES, 3.1, RED, STRENGTH)
    expected = np.rint(canvas.colours)
    np.testing.assert_array_equal(canvas.take_picture(), expected)
    np.testing.assert_array_equal(canvas.colours, ground)
    np.testing.assert_array_equal(canvas.take_picture(), ground)
    assert not canvas.sheet.share.any()
