"""One instance of the mechanics' FMU with any parameters and inputs, for tests."""

from collections.abc import Iterable
from ctypes import Array, c_double, c_int
from typing import Any, Self

from cosim.mechanics.fmi import Interface, references

COMPLIANT, RIGID = 1, 2
FIRST_INTEGER = 1001  # value references from here on are integers (fmu/README.md)

FREE_BODIES: dict[str, float] = {
    "gravity": 0.0,
    "force_factor": 1.0,  # the current is a force in N
    "flexure_stiffness": 1e-6,  # the least that is allowed: below 1e-9 of the forces
    "flexure_damping": 0.0,
    "suspension_k1": 1e-12,  # of no account, but the ram starts at q = 0
    "suspension_k3": 0.0,
    "suspension_damping": 0.0,
}
"""Nothing but the coil's force, the walls and friction acts: closed forms are short."""


class Bench:
    """Steps an instance from time 0. All values SI; names as in ``variables.def``."""

    def __init__(self, version: int = 3, /, **start: float) -> None:
        """Set parameters and first inputs, then initialise."""
        self._version = version
        self._known = references(version)
        self.fmi = Interface(version)
        self.time = 0.0
        self.set(**start)
        self.fmi.initialise()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.fmi.close()

    def _is_integer(self, name: str) -> bool:
        return self._known[name] >= FIRST_INTEGER

    def set(self, **values: float) -> None:
        reals = {n: v for n, v in values.items() if not self._is_integer(n)}
        integers = {n: int(v) for n, v in values.items() if self._is_integer(n)}
        if reals:
            array: Any = (c_double * len(reals))(*reals.values())
            self.fmi.set_reals(self.fmi.places(tuple(reals)), array)
        if integers:
            array = (c_int * len(integers))(*integers.values())
            self.fmi.set_integers(self.fmi.places(tuple(integers)), array)

    def get(self, *names: str) -> list[float]:
        """Values of variables in the order of their names; integers as floats."""
        values = {}
        for integer in (False, True):
            group = [n for n in names if self._is_integer(n) == integer]
            if not group:
                continue
            array: Array[Any] = ((c_int if integer else c_double) * len(group))()
            read = self.fmi.get_integers if integer else self.fmi.get_reals
            read(self.fmi.places(group), array)
            values.update(zip(group, array, strict=True))
        return [float(values[n]) for n in names]

    def __getitem__(self, name: str) -> float:
        return self.get(name)[0]

    def step(self, h: float, **inputs: float) -> None:
        """Set inputs and advance by ``h``."""
        if inputs:
            self.set(**inputs)
        self.fmi.do_step(self.time, h)
        self.time += h

    def run_to(self, time: float, h: float | None = None, **inputs: float) -> None:
        """Set inputs and advance to ``time`` in steps of at most ``h``, else in one."""
        self.set(**inputs)
        while time - self.time > 1e-15:
            left = time - self.time
            self.step(left if h is None or left < 1.5 * h else h)


def ends(parameters: dict[str, float], time: float, names: Iterable[str]) -> list[float]:
    """Values after one step from the start."""
    with Bench(**parameters) as bench:
        bench.run_to(time)
        return bench.get(*names)
