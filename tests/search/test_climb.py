"""The search finds minima that are known, and asks for the same points each time."""

from collections.abc import Callable

import numpy as np
import pytest

from cosim.arrays import Array
from cosim.search.climb import Climb, apart

RIDGE = np.array([0.83, 0.21, 0.57])


def ridge(points: Array) -> Array:
    """A narrow valley aslant to the axes with its least, 0, at RIDGE, and no value in a corner."""
    off = points - RIDGE
    along = off @ np.array([1.0, 1.0, 1.0]) / np.sqrt(3.0)
    across = off - np.outer(along, np.array([1.0, 1.0, 1.0]) / np.sqrt(3.0))
    cost = along**2 + 100.0 * np.sum(across**2, axis=1)
    return np.where(points.sum(axis=1) < 0.6, np.inf, cost)


def steps(points: Array) -> Array:
    """Whole numbers of a key with seven values, the least at the fifth."""
    return np.abs(np.round(points[:, 0] * 6.0) - 4.0)


def searched(
    cost: Callable[[Array], Array], keys: int, runs: int, seed: int
) -> tuple[Array, Array]:
    search, left = Climb(keys, round(0.4 * runs), seed), runs
    points, costs = np.empty((0, keys)), np.empty(0)
    while left:
        asked = search.ask(left)
        assert asked.shape[1] == keys and asked.min() >= 0.0 and asked.max() <= 1.0
        found = cost(asked)
        search.tell(asked, found)
        points, costs = np.vstack([points, asked]), np.concatenate([costs, found])
        left -= len(asked)
    return points, costs


@pytest.mark.parametrize("seed", range(5))
def test_a_ridge(seed: int) -> None:
    points, costs = searched(ridge, 3, 500, seed)
    assert costs.min() < 1e-3, points[costs.argmin()]
    np.testing.assert_array_equal(points, searched(ridge, 3, 500, seed)[0])


@pytest.mark.parametrize("keys", [1, 2])
def test_few_keys(keys: int) -> None:
    assert searched(steps, keys, 60, 1)[1].min() == 0.0
    points, costs = searched(lambda p: np.sum((p - 0.3141) ** 2, axis=1), keys, 300, 2)
    assert points[costs.argmin()] == pytest.approx(0.3141, abs=2e-3)


def test_climbs_begin_apart() -> None:
    """So a second peak is found that is lower than where the first climb began."""

    def peaks(points: Array) -> Array:
        low = np.sum((points - [0.2, 0.2]) ** 2, axis=1)
        high = np.sum((points - [0.8, 0.8]) ** 2, axis=1) - 1e-3
        return np.minimum(low, high)

    found = [searched(peaks, 2, 800, seed)[1].min() for seed in range(6)]
    assert max(found) < -0.9e-3


def test_apart() -> None:
    points = np.array([[0.1], [0.12], [0.3], [0.25], [0.9]])
    assert apart(points, 0.1, -1) == [0, 2, 4]
    assert apart(points, 0.1, 2) == [0, 2]
