"""ngspice, led through PySpice: the library, its callbacks, and one run.

Order of calls within a transient run (ngspice 39): for each attempted step ``GetVSRCData`` at every
Newton iteration and then ``GetSyncData`` at location 1; for an accepted one ``SendData`` and then
``GetSyncData`` at location 0, where the next step may be shortened. No such call follows the last.

Importing this module loads PySpice, which takes a while: only runs with a circuit do.
"""

import logging
import os
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from ctypes import byref, c_void_p, cast
from ctypes.util import find_library
from functools import cache
from math import nan
from tempfile import TemporaryDirectory
from typing import Any, Protocol

from PySpice.Spice.NgSpice import Shared

from cosim.coupling.loop.compiled import library
from cosim.errors import BadInput, SimulationFailed
from cosim.toolchain.interrupts import caught_signals

_ACCEPTED = 0
"""Location of a GetSyncData call that follows an accepted step."""

_ffi: Any = Shared.ffi

# It warns of versions newer than itself, and of words on stderr that are no errors.
logging.getLogger(Shared.__name__).setLevel(logging.CRITICAL)


_TROUBLE = re.compile(
    r"error|too small|singular|converge|failed|abort|can.t|cannot|could not|unknown|undefined|not ",
    re.IGNORECASE,
)
_NOISE = re.compile(
    r"^Note|init|ngspice.dll|circuits? loaded|is ignored|No compatibility", re.IGNORECASE
)
"""What it says of itself, and what only follows from an earlier word."""


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
    name = library_name()
    try:
        return Engine(name)
    except OSError as error:
        raise BadInput(f"{name}: this ngspice library cannot be loaded ({error}).") from error


def library_name() -> str:
    """The path or name of libngspice on this machine. Raises BadInput where it is missing."""
    name = os.environ.get("NGSPICE_LIBRARY_PATH") or _find_library()
    if name is None:
        raise BadInput(
            "libngspice was not found; install it (Debian and Ubuntu: libngspice0, macOS: brew "
            "install libngspice) or name it in NGSPICE_LIBRARY_PATH."
        )
    return name


def spoilt() -> bool:
    """Whether ngspice has given up in this process: then another process must run the circuit."""
    return engine.cache_info().currsize > 0 and engine().poisoned


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
        # A path is made absolute, since it is opened from another folder; a bare name is not.
        self.LIBRARY_PATH = os.path.abspath(library) if os.sep in library else library
        self.poisoned = False
        """ngspice has given up for good: nothing runs in this process's library any more."""
        self._leader: Leader | None = None
        self._circuit: Any = None
        self._circuit_places: Any = None
        self._failure: BaseException | None = None
        self._sources: dict[bytes, Callable[[float], float]] = {}
        self._save: tuple[str, ...] = ()
        self._places: list[int] = []
        self._values: list[float] = []
        self._time_place = -1
        self._time = self._told = 0.0
        with caught_signals(self.fail), _nowhere():
            super().__init__(ngspice_id=0, send_data=True)
            self._library: Any = self._ngspice_shared
            # PySpice leaves GetSyncData out; a second call puts it in beside its own.
            self._sync_c = _ffi.callback("GetSyncData", self._get_sync_data)
            self._call_back(self._get_vsrc_data_c, self._sync_c)
        if self._failure is not None:
            raise self._failure

    @property
    def _send_data_c(self) -> Any:
        """What PySpice gives to ngspice for SendData. It must be given when the library starts, so
        the compiled one stands there for good, and hands on where it is not wanted.
        """
        library().coupled_hand_on(int(_ffi.cast("uintptr_t", self._plain_data)))
        return _compiled("SendData", "coupled_data")

    @_send_data_c.setter
    def _send_data_c(self, plain: Any) -> None:
        self._plain_data = plain

    def run_transient(self, deck: str, save: tuple[str, ...], leader: Leader) -> None:
        """Run the transient analysis of ``deck``; ``save`` are its saved vectors, in this order.

        Raises what the leader raised, or SimulationFailed with ngspice's own words.
        """
        self._leader, self._sources = leader, {}
        self._call_back(self._get_vsrc_data_c, self._sync_c)
        try:
            self._run(deck, save)
            if self._time > self._told:
                leader.accepted(self._time, self._values, 0.0)
        finally:
            self._leader = None

    def run_compiled(self, deck: str, save: tuple[str, ...], circuit: Any, places: Any) -> None:
        """The same, led by compiled code: ``circuit`` is its ``Circuit``, with its ``places``.

        What it finds wrong stands in ``circuit.status``.
        """
        compiled = library()
        self._circuit, self._circuit_places = circuit, places
        self._call_back(
            _compiled("GetVSRCData", "coupled_source"), _compiled("GetSyncData", "coupled_step")
        )
        compiled.coupled_lead(byref(circuit))
        try:
            self._run(deck, save)
        finally:
            compiled.coupled_finish(byref(circuit))
            self._circuit = self._circuit_places = None

    def _call_back(self, source: Any, sync: Any) -> None:
        self._library.ngSpice_Init_Sync(
            source, self._get_isrc_data_c, sync, _ffi.NULL, self._self_c
        )

    def _run(self, deck: str, save: tuple[str, ...]) -> None:
        self._failure = None
        self._save = save
        self._time, self._told = 0.0, 0.0
        self.clear_output()
        try:
            with caught_signals(self.fail):
                # Not PySpice's load_circuit and run: they take any word on stderr, and any node
                # with "error" in its name, for a failure. What fails is known by what is missing.
                self._load(deck)
                if not self.poisoned:
                    self._library.ngSpice_Command(b"run")
            if self._failure is not None:
                raise self._failure
        finally:
            if not self.poisoned:
                for command in (b"destroy all", b"remcirc"):
                    self._library.ngSpice_Command(command)

    def _load(self, deck: str) -> None:
        lines = [_ffi.new("char[]", line.encode()) for line in (*deck.splitlines(), "")]
        self._library.ngSpice_Circ(_ffi.new("char *[]", [*lines, _ffi.NULL]))

    def said(self) -> str:
        """ngspice's own words of trouble, as the end of a message."""
        words = [" ".join(word.split()) for word in (*self._stderr, *self._stdout)]
        telling = [word for word in words if _TROUBLE.search(word) and not _NOISE.search(word)]
        return "; ".join(dict.fromkeys(telling[:4])).rstrip(".!") or "it gave no reason"

    def fail(self, failure: BaseException) -> None:
        """Make ngspice give up (its sources become NaN, no step can succeed); what runs it raises
        ``failure`` then. An exception cannot pass through C.
        """
        if self._failure is None:
            self._failure = failure
        if self._circuit is not None:
            self._circuit.stopped = 1

    @staticmethod
    def _exit(
        exit_status: int, immediate_unloding: bool, quit_exit: bool, ngspice_id: int, user_data: Any
    ) -> int:
        _ffi.from_handle(user_data).poisoned = True
        return exit_status

    @staticmethod
    def _send_init_data(data: Any, ngspice_id: int, user_data: Any) -> int:
        self = _ffi.from_handle(user_data)
        try:
            names = [_ffi.string(data.vecs[i].vecname).decode() for i in range(data.veccount)]
            names = [name.lower() for name in names]
            self._places = [names.index(_vector(name)) for name in self._save]
            self._values = [0.0] * len(self._places)
            self._time_place = names.index("time")
            if self._circuit_places is not None:
                self._circuit_places[:] = [*self._places, self._time_place]
        except ValueError as error:
            self.fail(SimulationFailed(f"The netlist has no such vector: {error}."))
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
            self.fail(failure)
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
            self.fail(failure)
        return 0


@contextmanager
def _nowhere() -> Iterator[None]:
    """In an empty folder that is also home: ngspice runs the .spiceinit that it finds in either."""
    here, home = os.getcwd(), os.environ.get("HOME")
    with TemporaryDirectory() as empty:
        os.chdir(empty)
        os.environ["HOME"] = empty
        try:
            yield
        finally:
            os.chdir(here)
            if home is None:
                del os.environ["HOME"]
            else:
                os.environ["HOME"] = home


def _compiled(kind: str, name: str) -> Any:
    """A function of the compiled library as a callback of ngspice."""
    address = cast(getattr(library(), name), c_void_p).value
    return _ffi.cast(f"{kind} *", address)


def _vector(name: str) -> str:
    """What ngspice calls a saved vector: ``i(vemf)`` is ``vemf#branch``, ``v(out)`` is ``out``."""
    kind, _, inner = name.lower().rstrip(")").partition("(")
    return f"{inner}#branch" if kind == "i" else inner
