"""Event-aware: a macro step ends at a stick-slip or impact event, and extrapolation begins anew.

Wraps a method with macro steps. A step in which the second side has met an event is put back and
repeated, shortened by bisection, until it ends just behind the event; what was extrapolated then
forgets everything older. Where nothing jumps the method keeps its own order; without this, events
leave first order or less (measured 0.5 to 1.6 at stick-slip: extrapolating across an event does
harm). Handling of events by step localisation: Gomes et al., "Co-simulation: a survey", ACM
Comput. Surv. 51 (2018) 49, section on hybrid co-simulation. Known limits: needs participants that
can repeat a step, so ngspice cannot take part; costs some 20 repeated steps an event.
"""

from typing import Any

from cosim.coupling.method import Past
from cosim.coupling.rewind.joint import Joint


class EventAware:
    """Takes macro steps of a method, cut at the events of its second side."""

    def __init__(self, method: Joint, within: float = 1e-9) -> None:
        """An event is met to ``within`` seconds."""
        self.method = method
        self._within = within
        self.events = 0
        """Macro steps that were cut."""

    @property
    def time(self) -> float:
        return self.method.time

    @property
    def past(self) -> Past:
        return self.method.past

    def step(self, h: float) -> None:
        """Go on by ``h`` seconds, in as many macro steps as there are events in it, and one."""
        end = self.method.time + h
        while (left := end - self.method.time) > 1e-12 * max(end, h):
            saved = self.method.save()
            count = self.method.second.events()
            self.method.step(left)
            if self.method.second.events() == count:
                return
            if left > self._within:
                self._cut(saved, count, left)
            self.method.restart()
            self.events += 1

    def _cut(self, saved: Any, count: int, step: float) -> None:
        """Repeat the step, ended just behind its first event."""
        before, behind = 0.0, step
        while behind - before > self._within:
            middle = 0.5 * (before + behind)
            self.method.restore(saved)
            self.method.step(middle)
            if self.method.second.events() == count:
                before = middle
            else:
                behind = middle
        self.method.restore(saved)
        self.method.step(behind)

    def save(self) -> Any:
        return self.method.save()

    def restore(self, saved: Any) -> None:
        self.method.restore(saved)
