"""The methods between participants that can go back, as the studies compare them."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, get_args

from cosim.coupling.methods import methods
from cosim.coupling.rewind.iterated import Acceleration, Iterated, PredictorCorrector
from cosim.coupling.rewind.joint import EventAware, Joint


@dataclass(frozen=True)
class Variant:
    """``make`` joins circuit and mechanics; ``order`` is that of the error where nothing jumps."""

    make: Callable[[Any, Any], Joint]
    order: int


def variants(tolerance: float = 1e-9) -> dict[str, Variant]:
    """Each by its name; ``tolerance`` is that of iterations, relative."""
    found: dict[str, Variant] = {}
    for kind in methods().values():
        for name, method in kind.variants.items():
            found[name] = Variant(lambda a, b, make=method: Joint(a, b, make()), method().order)
    locked = methods()["step-locked"]
    cut = Variant(lambda a, b: EventAware(a, b, locked()), locked().order)
    found |= {"event-aware": cut, "predictor-corrector": Variant(PredictorCorrector, 2)}
    for acceleration in get_args(Acceleration):
        make = partial(Iterated, acceleration=acceleration, tolerance=tolerance)
        found[f"iterated, {acceleration}"] = Variant(make, 2)
    return found
