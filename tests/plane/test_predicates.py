from __future__ import annotations

import numpy as np
import pytest
from delaunay import in_circle, orient, rational
from from_python import from_python
from hypothesis import given
from hypothesis import strategies as st

from meshsimp_pymoo.plane import predicates
from meshsimp_pymoo.plane.predicates import exact_ranges

circle_sign, circle_sign_exact, orient_sign, orient_sign_exact = (
    from_python(getattr(predicates, name))
    for name in ("circle_sign", "circle_sign_exact", "orient_sign", "orient_sign_exact")
)

SCALE = 2**52
anywhere = st.integers(0, SCALE)
coarse = st.integers(0, 6).map(lambda k: k * (SCALE // 8))
huddled = st.integers(-4, 4).map(lambda k: SCALE // 2 + k)
inexact_grid = st.integers(0, 9).map(lambda k: int(k * 0.1 * SCALE))


def quadruples():
    """Four points: anywhere, on a coarse grid (ties), a few quanta apart, on a grid of inexact steps."""
    return st.one_of(
        *[st.lists(st.tuples(kind, kind), min_size=4, max_size=4) for kind in (anywhere, coarse, huddled, inexact_grid)]
    ).map(lambda rows: np.array(rows, float) / SCALE)


def sign(x):
    return (x > 0) - (x < 0)


@given(quadruples())
def test_predicates_equal_rational_arithmetic(xy):
    a, b, c, p = xy
    area, lift = exact_ranges(xy)
    exact = rational(xy)
    turn = sign(orient(exact[0], exact[1], exact[3]))
    circle = sign(in_circle(*exact))
    differences = [*(a - p), *(b - p), *(c - p)]
    for bound in (0.0, area):
        assert orient_sign(*(a - p), *(b - p), bound) == turn
    for bound in (0.0, lift):
        assert circle_sign(*differences, bound) == circle
    assert orient_sign_exact(*(a - p), *(b - p)) == turn
    assert circle_sign_exact(*differences) == circle


def test_signs_by_hand():
    assert orient_sign(-0.5, -0.25, 0.5, -0.25, 0.0) == 1
    assert orient_sign(-0.5, -0.5, 0.5, 0.5, 0.0) == 0
    assert circle_sign(0.0, -1.0, 1.0, -1.0, 1.0, 0.0, 0.0) == 0
    assert circle_sign(-0.25, -0.5, 0.75, -0.5, 0.75, 0.5, 0.0) == 1


def test_upright_rectangles_of_inexact_sides_are_ties():
    rng = np.random.default_rng(3)
    for _ in range(200):
        x0, x1, y0, y1 = (rng.random(4) + 1.0) - 1.0
        corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
        for shift in range(4):
            a, b, c, p = np.roll(corners, shift, axis=0)
            assert circle_sign(*(a - p), *(b - p), *(c - p), 0.0) == 0


@pytest.mark.parametrize("nudge", [(1, 0), (-1, 0), (0, 1), (0, -1)])
def test_a_rectangle_with_one_corner_off_by_a_quantum_is_no_tie(nudge):
    rng = np.random.default_rng(4)
    for _ in range(5):
        x0, x1, y0, y1 = (0.1 + 0.8 * rng.random(4) + 1.0) - 1.0
        for corner in range(4):
            corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
            corners[corner] += np.array(nudge) / SCALE
            expected = sign(in_circle(*rational(corners)))
            assert expected != 0
            for shift in range(4):
                a, b, c, p = np.roll(corners, shift, axis=0)
                # round a circle: with every other corner the one in question changes sides
                assert circle_sign(*(a - p), *(b - p), *(c - p), 0.0) == expected * (-1) ** shift


@pytest.mark.parametrize(("step", "expected"), [(1 / 8, 2.0**-3), (3 / 1024, 2.0**-10), (0.1, 2.0**-52)])
def test_exact_ranges_find_the_quantum_of_a_grid(step, expected):
    xy = np.stack(np.meshgrid(np.arange(6) * step, np.arange(6) * step), -1).reshape(-1, 2)
    xy = (xy + 1.0) - 1.0
    area, lift = exact_ranges(xy)
    assert area <= 2.0**52 * expected**2 * 16
    assert area >= 2.0**52 * expected**2
    assert lift == area / 2.0**27
