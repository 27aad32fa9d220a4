"""A coupling method, written once for both masters.

A master advances the two sides: :mod:`cosim.coupling.loop.macro_steps` where ngspice leads, which
cannot repeat a step, :mod:`cosim.coupling.rewind.joint` between participants that can. Both
guarantee this order of calls::

    emf -> the circuit steps to the next communication point -> current -> the mechanics step there

and report to ``Past`` each communication point, jumps of the command, and events where they detect
them.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar

from cosim.coupling.polynomials import History, Polynomial


class Past:
    """The data that a method may use, at a communication point and after the circuit's next step.

    Signals are numbers or arrays, SI; polynomials are about the communication point.
    """

    def __init__(self, method: "Method") -> None:
        self.time = 0.0
        """Time of the communication point, s."""
        self.current = History(2, False)
        """The circuit's output, A."""
        self.emf = History(method.degree, method.slopes)
        """The mechanics' output, V."""
        self.h = 0.0
        """Length of the circuit's step, s."""
        self.end: Any = 0.0
        """Current (A) at the end of the circuit's step."""
        self.mean: Any = 0.0
        """Mean current (A) over the circuit's step: its charge over ``h``."""
        self.gain: Any = 0.0
        """Bl²/m_eff at the communication point, V/(A s)."""
        self.carried: Any = 0.0
        """Share of the back-EMF (V) at the communication point that the circuit solves itself."""
        self.carried_slope: Any = 0.0
        """Time derivative of this share without any extrapolation, V/s."""

    def met(self, time: float, current: Any, current_slope: Any, emf: Any, emf_slope: Any) -> None:
        """Add a communication point at ``time`` (s): both outputs and slopes, None if unknown."""
        self.time = time
        self.current.add(time, current, current_slope)
        self.emf.add(time, emf, emf_slope)

    def stepped(self, time: float, end: Any, mean: Any) -> None:
        """Take the circuit's step to ``time`` (s): its current at the end and mean current, A."""
        self.h, self.end, self.mean = time - self.time, end, mean

    def restart(self) -> None:
        """Forget all points before the last one, at which a signal or its slope jumped."""
        self.current.restart()
        self.emf.restart()

    def save(self) -> tuple[Any, ...]:
        return (self.time, self.current.save(), self.emf.save())

    def restore(self, saved: tuple[Any, ...]) -> None:
        self.time, current, emf = saved
        self.current.restore(current)
        self.emf.restore(emf)


class Method(ABC):
    """How each side of a coupling sees the other between two communication points.

    Subclasses cite their source. The back-EMF is extrapolated with ``degree``; with ``slopes`` its
    true slope is used in place of the oldest value.
    """

    name: ClassVar[str]
    """The method's name in ``coupling.method``."""
    variants: ClassVar[dict[str, Callable[[], "Method"]]] = {}
    """Variants that the studies compare, by the names that they show."""
    carries_inertia = False
    """Whether the circuit solves a share of the back-EMF itself: ``Past.gain`` times its charge."""

    def __init__(self, degree: int = 1, slopes: bool = True) -> None:
        self.degree, self.slopes = degree, slopes

    @property
    @abstractmethod
    def order(self) -> int:
        """Order of convergence where nothing jumps."""

    def emf(self, past: Past) -> Polynomial:
        """The back-EMF (V) that the circuit sees until the next communication point."""
        return past.emf.polynomial(self.degree)

    @abstractmethod
    def current(self, past: Past) -> Polynomial:
        """The current (A) that the mechanics are fed over the step that the circuit has taken."""
