"""The largest macro step at which a coupling is stable: predicted, and observed.

Predicted: a fixed-step method between linear participants is a linear map of all that is kept from
one macro step to the next (the states of both sides and the histories of exchanged signals). The
matrix of this map is obtained by one step of the method from a basis of unit vectors; the method is
stable while the spectral radius is at most 1.

Observed: the method runs, with any participants (also the FMU), from a small disturbance; it is
stable if the exchanged signals do not grow.
"""

from collections.abc import Callable
from math import isfinite
from typing import Any

import numpy as np

from cosim.coupling.polynomials import Array
from cosim.coupling.rewind.joint import Joint
from cosim.errors import SimulationFailed

_MARGIN = 1e-9
"""Rounding error of the spectral radius."""
_WARM_UP = 4  # macro steps until all histories are full
_UNBOUNDED, _NOISE = 1e7, 1e-4
"""Multiples of the initial size of the signals: above the first they grow without bound, below the
second they are noise."""
_SILENT = 10  # steps of noise alone before a failure, which then counts as stable


def _linear_map(method: Joint, h: float) -> Array:
    """The matrix of one macro step of ``h`` (s), from all that the method keeps to the same."""
    for _ in range(_WARM_UP):
        method.step(h)
    # Each array (leaf) of the saved state is replaced by its rows of the unit matrix, so that the
    # columns of all states advance together and form the matrix.
    shape = method.save()
    size = sum(leaf.size for leaf in _leaves(shape))
    basis = iter(np.split(np.eye(size), np.cumsum([leaf.size for leaf in _leaves(shape)])[:-1]))
    method.restore(_replaced(shape, basis))
    method.step(h)
    return np.concatenate(_leaves(method.save()))


def _is_stable(make: Callable[[], Joint], h: float) -> bool:
    """Whether no eigenvalue exceeds 1 in magnitude; False where the step itself fails."""
    try:
        m = _linear_map(make(), h)
    except SimulationFailed:
        return False
    return bool(np.isfinite(m).all() and np.abs(np.linalg.eigvals(m)).max() <= 1.0 + _MARGIN)


def largest_stable_step(
    make: Callable[[], Joint], low: float, high: float, leap: float = 1.15
) -> float:
    """The macro step (s) between ``low`` and ``high`` up to which the coupling is predicted stable.

    The first limit from below, to a relative error of 0.001; ``high`` where all steps are stable,
    0 where ``low`` is not. Unstable intervals shorter than a ``leap`` (a ratio) may be missed.
    ``make`` gives the method between two homogeneous linear participants.
    """
    return _first_limit(lambda h: _is_stable(make, h), low, high, 1e-3, leap)


def observed_limit(
    make: Callable[[], Joint], low: float, high: float, steps: int = 600, leap: float = 1.15
) -> float:
    """As ``largest_stable_step``, to a relative error of 0.02, by running the method; ``make``
    gives it disturbed from its equilibrium."""
    return _first_limit(lambda h: _remains_bounded(make, h, steps), low, high, 0.02, leap)


def _remains_bounded(make: Callable[[], Joint], h: float, steps: int) -> bool:
    """Whether the exchanged signals do not grow over ``steps`` macro steps of ``h`` (s): their
    largest size in the last quarter is compared with that in the second quarter.
    """
    method = make()
    quarter = steps // 4
    sizes = np.zeros(steps)
    begun = _size(method)
    # A motion that has died away leaves the noise of the participants' solvers. There iterations
    # may fail, and bodies may stick and slip for ever; neither counts as unstable.
    floor = lambda: _NOISE * max(begun, sizes[:quarter].max())  # noqa: E731
    for k in range(steps):
        try:
            method.step(h)
        except (SimulationFailed, FloatingPointError, ValueError):
            late = sizes[max(k - _SILENT, 0) : k]
            return bool(k > _SILENT and late.max() <= floor())
        sizes[k] = _size(method)
        if not isfinite(sizes[k]) or sizes[k] > _UNBOUNDED * begun:
            return False
    late, before = sizes[3 * quarter :].max(), sizes[quarter : 2 * quarter].max()
    return bool(late <= 1.0001 * before + floor())


def _size(method: Joint) -> float:
    """The largest magnitude of the exchanged current (A) and back-EMF (V)."""
    past = method.past
    return float(max(np.abs(past.current.value).max(), np.abs(past.emf.value).max()))


def _first_limit(
    stable: Callable[[float], bool], low: float, high: float, tolerance: float, leap: float
) -> float:
    """Leaps up to the first unstable step, then bisects (geometrically) between the last two."""
    if not stable(low):
        return 0.0
    inside, outside = low, low
    while outside < high:
        outside = min(leap * inside, high)
        if not stable(outside):
            break
        inside = outside
    else:
        return high
    while outside > (1.0 + tolerance) * inside:
        middle = (inside * outside) ** 0.5
        if stable(middle):
            inside = middle
        else:
            outside = middle
    return inside


def _leaves(saved: Any) -> list[Array]:
    """The arrays in a nested tuple, which are the linear state; times and other items are not."""
    if isinstance(saved, np.ndarray):
        return [saved]
    if isinstance(saved, tuple):
        return [leaf for part in saved for leaf in _leaves(part)]
    return []


def _replaced(saved: Any, leaves: Any) -> Any:
    """The nested tuple with its arrays replaced by the next ``leaves``."""
    if isinstance(saved, np.ndarray):
        return next(leaves)
    if isinstance(saved, tuple):
        return tuple(_replaced(part, leaves) for part in saved)
    return saved
