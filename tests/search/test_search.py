"""The searches find maxima that are known, and ask for the same points each time."""

from collections.abc import Callable

import numpy as np
import pytest

from cosim.arrays import Array
from cosim.search.known import Feasible, Known, apart
from cosim.search.searches import Climb, Design
from cosim.search.turns import TURN, corners, faces

RIDGE = np.array([0.83, 0.21, 0.57])
FINE = 10**9


def ridge(points: Array) -> Array:
    """A narrow ridge aslant to the axes with its top, 0, at RIDGE, and no value in a corner."""
    off = points - RIDGE
    along = off @ np.array([1.0, 1.0, 1.0]) / np.sqrt(3.0)
    across = off - np.outer(along, np.array([1.0, 1.0, 1.0]) / np.sqrt(3.0))
    cost = along**2 + 100.0 * np.sum(across**2, axis=1)
    return np.where(points.sum(axis=1) < 0.6, -np.inf, -cost)


def steps(points: Array) -> Array:
    """Whole numbers of a key with seven values, the best at the fifth."""
    return -np.abs(np.round(points[:, 0] * 6.0) - 4.0)


def known(score: Callable[[Array], Array], keys: int) -> Known:
    def evaluate(points: Array) -> tuple[Array, Feasible]:
        assert points.shape[1] == keys and points.min() >= 0.0 and points.max() <= 1.0
        found = score(points)
        return found[:, None], np.isfinite(found)

    return Known(keys, 1, FINE, evaluate)


def searched(score: Callable[[Array], Array], keys: int, runs: int, seed: int) -> Known:
    found, explored = known(score, keys), round(0.4 * runs)
    found.search({0: Design(keys, explored, seed)}, explored)
    found.search({0: Climb(keys, seed)}, runs - explored)
    assert len(found.points) <= runs
    return found


@pytest.mark.parametrize("seed", range(5))
def test_a_ridge(seed: int) -> None:
    found = searched(ridge, 3, 500, seed)
    assert found.tops() > -1e-3, found.ranked(0, 0.0, 1)
    np.testing.assert_array_equal(found.points, searched(ridge, 3, 500, seed).points)


@pytest.mark.parametrize("keys", [1, 2])
def test_few_keys(keys: int) -> None:
    assert searched(steps, keys, 60, 1).tops() == 0.0
    found = searched(lambda p: -np.sum((p - 0.3141) ** 2, axis=1), keys, 300, 2)
    assert found.ranked(0, 0.0, 1)[0] == pytest.approx(0.3141, abs=2e-3)


def test_climbs_begin_apart() -> None:
    """So a second peak is found that is higher than where the first climb began."""

    def peaks(points: Array) -> Array:
        low = np.sum((points - [0.2, 0.2]) ** 2, axis=1)
        high = np.sum((points - [0.8, 0.8]) ** 2, axis=1) - 1e-3
        return -np.minimum(low, high)

    assert min(searched(peaks, 2, 800, seed).tops()[0] for seed in range(6)) > 0.9e-3


def test_a_design_keeps_to_what_is_feasible() -> None:
    """A ninth of the cube; and points are dense where a key is near an end of its range."""
    asked: list[Array] = []

    def evaluate(points: Array) -> tuple[Array, Feasible]:
        asked.append(points)
        return np.zeros((len(points), 1)), np.asarray((points[:, :2] < 1 / 3).all(axis=1))

    Known(3, 1, 1023, evaluate).search({0: Design(3, 256, 0, ends=True)}, 256)
    first, later = asked[0], np.vstack(asked[1:])
    assert len(first) + len(later) == pytest.approx(256, abs=4)  # some fall on the same step
    # By the arcsine law 0.39 lie in the first third of a turn, and 0.20 in either tenth.
    assert 0.08 < (first[:, :2] < 1 / 3).all(axis=1).mean() < 0.25
    assert (later[:, :2] < 1 / 3).all(axis=1).mean() > 0.6
    assert 0.15 < (later[:, 2] > 0.9).mean() < 0.26


def test_points_are_run_once_where_they_can_be_set() -> None:
    asked: list[float] = []

    def evaluate(points: Array) -> tuple[Array, Feasible]:
        asked.extend(points[:, 0].tolist())
        return points, points[:, 0] < 0.7

    found = Known(1, 1, 10, evaluate)
    points = np.array([[0.31], [0.29], [0.9], [-1.0], [0.3]])
    assert found.rows(points) == [0, 0, 1, 2, 0] and found.rows(points[2:]) == [1, 2, 0]
    assert asked == [0.3, 0.9, 0.0]
    np.testing.assert_array_equal(found.scores[:, 0], [0.3, -np.inf, 0.0])
    assert found.tops() == 0.3 and found.ranked(0, 0.05, 9)[:, 0].tolist() == [0.3, 0.0]


def test_what_lies_broad_is_told_from_a_needle() -> None:
    def both(points: Array) -> Array:
        off = np.abs(points - 0.2).max(axis=1)
        return np.where(off < 0.001, 2.0, np.exp(-np.sum((points - 0.7) ** 2, axis=1) / 0.02))

    found = known(both, 2)
    around = np.random.default_rng(0).uniform(-0.02, 0.02, (20, 2))
    found.rows(np.vstack([[[0.2, 0.2], [0.7, 0.7]], 0.2 + around, 0.7 + around]))
    assert found.ranked(0, 0.0, 1)[0].tolist() == [0.2, 0.2]
    assert found.steady(0, 0.1, 1)[0] == pytest.approx(0.7, abs=0.02)


def test_apart() -> None:
    points = np.array([[0.1], [0.12], [0.3], [0.25], [0.9]])
    assert apart(points, 0.1, -1) == [0, 2, 4]
    assert apart(points, 0.1, 2) == [0, 2]


def test_turns_stay_inside() -> None:
    assert faces(np.array([0.5, 1.0])).tolist() == [
        [0.5 + TURN, 1.0], [0.5, 1.0], [0.5 - TURN, 1.0], [0.5, 1.0 - TURN],
    ]  # fmt: skip
    turned = corners(np.array([0.5, 0.0, 0.3]))
    assert len(turned) == 8 and turned.min() == 0.0
    assert {round(x, 9) for x in turned[:, 2].tolist()} == {0.28, 0.32}
