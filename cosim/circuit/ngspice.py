"""ngspice, led through PySpice: the library, its callbacks, and one run.

Order of calls within a transient run (ngspice 39): for each attempted step ``GetVSRCData`` at every
Newton iteration and then ``GetSyncData`` at location 1; for an accepted one ``SendData`` and then
``GetSyncData`` at location 0, where the next step may be shortened. No such call follows the last.

Importing this module loads PySpice, which takes a while: only runs with a circuit do.
"""

import logging
import os
import sys
from collections.abc import Callable, Sequence
from ctypes.util import find_library
from functools import cache
from math import nan
from typing import Any, Protocol

from PySpice.Spice.NgSpice import Shared

from cosim.errors import BadInput, SimulationFailed

_ACCEPTED = 0
"""Location of a GetSyncData call that follows an accepted step."""

_ffi: Any = Shared.ffi

# It warns of versions newer than itself, and of words on stderr that are no errors.
logging.getLogger(Shared.__name__).setLevel(logging.CRITICAL)


class Leader(Protocol):
    """What ngspice asks for while it leads a run."""

    def source(self, name: str) -> Callable[[float], float]:
        """The function of time (s) that gives the voltage (V) of an external source."""
        ...

    def attempted(self) -> None:
        """A step was tried."""
        ...

    def accepted(self, time: float, values: Sequence[float], next_step: float) -> float:
        """A step to ``time`` (s) was accepted, with the values of the saved vectors.

        Returns the next step, s: ``next_step`` or less.
        """
        ...


@cache
def engine() -> "Engine":
    """The process's one ngspice. Raises BadInput where the library is missing."""
    name = os.environ.get("NGSPICE_LIBRARY_PATH") or _find_library()
    if name is None:
        raise BadInput(
            "libngspice was not found; install it (Debian and Ubuntu: libngspice0, macOS: brew "
            "install libngspice) or name it in NGSPICE_LIBRARY_PATH."
        )
    try:
        return Engine(name)
    except OSError as error:
        raise BadInput(f"{name}: this ngspice library cannot be loaded ({error}).") from error


def _find_library() -> str | None:
    """libngspice as the loader finds it: Debian's runtime package has only the versioned name."""
    found = find_library("ngspice")
    if found is None and sys.platform == "darwin":
        for folder in ("/opt/homebrew/lib", "/usr/local/lib"):
            if os.path.exists(path := f"{folder}/libngspice.dylib"):
                return path
    return found


class Engine(Shared.NgSpiceShared):
    """One ngspice library, with the callbacks of the run under way.

    The static methods replace PySpice's own, which turn every value into Python objects.
    """

    def __init__(self, library: str) -> None:
        self.LIBRARY_PATH = library
        self._leader: Leader | None = None
        self._failure: BaseException | None = None
        self._sources: dict[bytes, Callable[[float], float]] = {}
        self._save: tuple[str, ...] = ()
        self._places: list[int] = []
        self._values: list[float] = []
        self._time_place = -1
        self._time = self._told = 0.0
        super().__init__(ngspice_id=0, send_data=True)
        self._library: Any = self._ngspice_shared
        # PySpice leaves GetSyncData out; a second call puts it in beside its own.
        self._sync_c = _ffi.callback("GetSyncData", self._get_sync_data)
        self._library.ngSpice_Init_Sync(
            self._get_vsrc_data_c, self._get_isrc_data_c, self._sync_c, _ffi.NULL, self._self_c
        )

    def run_transient(self, deck: str, save: tuple[str, ...], leader: Leader) -> None:
        """Run the transient analysis of ``deck``; ``save`` are its saved vectors, in this order.

        Raises what the leader raised, or SimulationFailed with ngspice's own words.
        """
        self._leader, self._failure = leader, None
        self._sources, self._save = {}, save
        self._time, self._told = 0.0, 0.0
        try:
            self.load_circuit(deck)
            self.clear_output()
            # Not PySpice's run: it takes any word on stderr for a failure.
            self._library.ngSpice_Command(b"run")
            if self._failure is not None:
                raise self._failure
            if self._time > self._told:
                leader.accepted(self._time, self._values, 0.0)
        except (Shared.NgSpiceCircuitError, NameError) as error:
            raise SimulationFailed(f"ngspice cannot load the netlist: {self.said()}") from error
        finally:
            self._leader = None
            for command in (b"destroy all", b"remcirc"):
                self._library.ngSpice_Command(command)

    def said(self) -> str:
        """ngspice's last words of trouble, as the end of a message."""
        words = [*self._stderr, *self._stdout]
        telling = [w for w in words if "rror" in w or "too small" in w or "arning" in w]
        return "; ".join(w.strip() for w in (telling or words)[:3]) or "it gave no reason."

    def _fail(self, failure: BaseException) -> None:
        # An exception cannot pass through C. ngspice is made to give up (its sources become NaN,
        # no step can succeed), and run_transient() raises it then.
        if self._failure is None:
            self._failure = failure

    @staticmethod
    def _send_init_data(data: Any, ngspice_id: int, user_data: Any) -> int:
        self = _ffi.from_handle(user_data)
        try:
            names = [_ffi.string(data.vecs[i].vecname).decode() for i in range(data.veccount)]
            names = [name.lower() for name in names]
            self._places = [names.index(_vector(name)) for name in self._save]
            self._values = [0.0] * len(self._places)
            self._time_place = names.index("time")
        except ValueError as error:
            self._fail(SimulationFailed(f"The netlist has no such vector: {error}."))
        return 0

    @staticmethod
    def _send_data(data: Any, number_of_vectors: int, ngspice_id: int, user_data: Any) -> int:
        self = _ffi.from_handle(user_data)
        vectors = data.vecsa
        self._values = [vectors[place].creal for place in self._places]
        self._time = vectors[self._time_place].creal
        return 0

    @staticmethod
    def _get_vsrc_data(
        voltage: Any, time: float, node: Any, ngspice_id: int, user_data: Any
    ) -> int:
        self = _ffi.from_handle(user_data)
        try:
            if self._failure is not None:
                voltage[0] = nan
                return 0
            name = _ffi.string(node)
            source = self._sources.get(name)
            if source is None:
                source = self._leader.source(name.decode().lower())
                self._sources[name] = source
            voltage[0] = source(time)
        except BaseException as failure:
            voltage[0] = nan
            self._fail(failure)
        return 0

    @staticmethod
    def _get_sync_data(
        time: float,
        delta: Any,
        old_delta: float,
        redo: int,
        ngspice_id: int,
        location: int,
        user_data: Any,
    ) -> int:
        self = _ffi.from_handle(user_data)
        try:
            if self._failure is not None:
                return 0
            if location == _ACCEPTED:
                self._told = time
                delta[0] = self._leader.accepted(time, self._values, delta[0])
            else:
                self._leader.attempted()
        except BaseException as failure:
            self._fail(failure)
        return 0


def _vector(name: str) -> str:
    """What ngspice calls a saved vector: ``i(vemf)`` is ``vemf#branch``, ``v(out)`` is ``out``."""
    kind, _, inner = name.lower().rstrip(")").partition("(")
    return f"{inner}#branch" if kind == "i" else inner
