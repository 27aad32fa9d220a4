"""A coupling method, written once for both masters.

A master is whoever moves the two sides: :mod:`cosim.coupling.loop.macro_steps` where ngspice leads
and cannot go back, :mod:`cosim.coupling.rewind.joint` between participants that can. Both
guarantee this order of calls::

    emf -> the circuit steps to the next communication point -> current -> the mechanics step there

and tell ``Past`` of each communication point, of jumps of the command, and of events where they
look for them.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar

from cosim.coupling.polynomials import History, Polynomial


class Past:
    """What a method knows, at a communication point and after the circuit's step from there.

    Signals are numbers or arrays, SI; polynomials are about the communication point.
    """

    def __init__(self, method: "Method") -> None:
        self.time = 0.0
        """s; of the communication point."""
        self.current = History(2, False)
        """Of the circuit's output, A."""
        self.emf = History(method.degree, method.slopes)
        """Of the mechanics' output, V."""
        self.h = 0.0
        """s; length of the circuit's step."""
        self.end: Any = 0.0
        """The current (A) that it ended with."""
        self.mean: Any = 0.0
        """Mean current (A) over it, which carries its exact charge."""
        self.gain: Any = 0.0
        """Bl²/m_eff at the communication point, V/(A s)."""
        self.carried: Any = 0.0
        """Share of the back-EMF (V) that the circuit carries itself there."""
        self.carried_slope: Any = 0.0
        """The slope that this share has by itself, V/s."""

    def met(self, time: float, current: Any, current_slope: Any, emf: Any, emf_slope: Any) -> None:
        """A communication point at ``time`` (s), with both outputs and their slopes; the slope is
        None where it is not known."""
        self.time = time
        self.current.add(time, current, current_slope)
        self.emf.add(time, emf, emf_slope)

    def stepped(self, time: float, end: Any, mean: Any) -> None:
        """The circuit has stepped to ``time`` (s)."""
        self.h, self.end, self.mean = time - self.time, end, mean

    def restart(self) -> None:
        """Forget what lies before the last communication point: something jumped there."""
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

    Subclasses cite their source. ``slopes``: the back-EMF's true slope counts as a known value of
    its extrapolation, of degree ``degree``, instead of a value one step older.
    """

    name: ClassVar[str]
    """As ``coupling.method`` has it."""
    variants: ClassVar[dict[str, Callable[[], "Method"]]] = {}
    """What the studies compare, by the name that they show."""
    carries_inertia = False
    """The circuit carries a share of the back-EMF itself: ``Past.gain`` times its charge."""

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
