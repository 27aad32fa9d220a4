"""ngspice, led through PySpice: the library, its callbacks, and one run.

Order of calls within a transient run (ngspice 39): for each attempted step ``GetVSRCData`` at every
Newton iteration and then ``GetSyncData`` at location 1; for an accepted one ``SendData`` and then
``GetSyncData`` at location 0, where the next step may be shortened. No such call follows the last.

The library reads the .spiceinit of its home and of the working folder, and the spinit of the folder
that a variable names: a worker has an empty folder for all of them.

Importing this module loads PySpice, which takes a while: only workers do.
"""

import logging
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any, Protocol

from PySpice.Spice.NgSpice import Shared

from cosim.circuit.lint.words import sent
from cosim.errors import BadInput, SimulationFailed, plain
from cosim.toolchain.libraries import ngspice_library
from cosim.toolchain.processes import retire

_ffi: Any = Shared.ffi

# It warns of versions newer than itself, and of words on stderr that are no errors.
logging.getLogger(Shared.__name__).setLevel(logging.CRITICAL)


_TROUBLE = re.compile(
    r"error|too small|singular|converge|failed|abort|can.t|cannot|could not|unknown|undefined|not ",
    re.IGNORECASE,
)
_NOISE = re.compile(
    r"^Note|init|ngspice.dll|circuits? loaded|is ignored|No compatibility|@\w+\[pulse\]|"
    "no such device or model name",  # which was asked for its edges
    re.IGNORECASE,
)
"""What it says of itself, and what only follows from an earlier word."""


_SINGULAR = re.compile(r"singular matrix: check (nodes? \S+(?: and \S+)?)", re.IGNORECASE)

LOOSER = "abstol=1e-8 vntol=1e-5 chgtol=1e-11"
"""A, V, C. ngspice's own 1 pA, 1 uV and 10 fC are made for integrated circuits: where amperes are
switched, no step is small enough for them."""


class Leader(Protocol):
    """What the compiled callbacks act for, during a run."""

    places: Any
    """ctypes array, to be filled: where the saved vectors are among those sent; then the time."""

    def begin(self) -> None:
        """The callbacks act for this run from now on."""

    def finish(self) -> None:
        """No further step comes; the last one was not told of."""

    def loaded(self, engine: "Engine") -> None:
        """The circuit is there, its run not yet begun."""

    def stop(self) -> None:
        """Nothing is to be done any more: the sources become NaN, so that no step succeeds."""


@cache
def engine(data: int, source: int, step: int) -> "Engine":
    """The process's one ngspice, which calls compiled functions at these addresses: SendData,
    GetVSRCData, GetSyncData. Python would take longer than ngspice itself. Raises BadInput where
    the library is missing.

    It loads no code models: ``lint/dialect.py`` writes what would need them otherwise, and each
    step looks at all kinds of elements, so they would cost 5 % of a run.
    """
    name = ngspice_library()
    os.environ["SPICE_SCRIPTS"] = os.curdir  # not its own start-up file, which loads code models
    try:
        if os.sep in name and not os.path.isfile(name):  # to open a pipe would wait for ever
            raise OSError("there is no such file")
        return Engine(name, data, source, step)
    except (OSError, AttributeError) as error:  # the latter where it lacks ngspice's functions
        reason = str(error).partition("Additionally")[0].strip(" .")
        raise BadInput(
            f"{plain(name)}: this ngspice library cannot be loaded ({plain(reason)}); does "
            "NGSPICE_LIBRARY_PATH name it rightly?"
        ) from error


class Engine(Shared.NgSpiceShared):
    """One ngspice library, with compiled callbacks: PySpice's make an object of every value."""

    sent: tuple[str, ...] = ()
    """The names of all vectors of the run, as they are sent."""
    _looser = False
    poisoned = False
    """ngspice has given up for good: nothing runs in this process's library any more."""

    def __init__(self, library: str, data: int, source: int, step: int) -> None:
        self.LIBRARY_PATH = library
        self._leader: Leader | None = None
        self._failure: BaseException | None = None
        self._save: tuple[str, ...] = ()
        self._data = data
        super().__init__(ngspice_id=0, send_data=True)
        self._library: Any = self._ngspice_shared
        # PySpice leaves GetSyncData out; a second call puts it in, and a faster GetVSRCData.
        self._library.ngSpice_Init_Sync(
            _ffi.cast("GetVSRCData *", source),
            _ffi.cast("GetISRCData *", source),  # which has the same arguments
            _ffi.cast("GetSyncData *", step),
            _ffi.NULL,
            self._self_c,
        )

    @property
    def _send_data_c(self) -> Any:
        """What PySpice gives to ngspice for SendData when the library starts, and never again."""
        return _ffi.cast("SendData *", self._data)

    @_send_data_c.setter
    def _send_data_c(self, plain: Any) -> None:
        """PySpice sets its own."""

    def transient(self, deck: str, save: tuple[str, ...], leader: Leader) -> None:
        """Run the transient analysis of ``deck``; ``save`` are its saved vectors, in this order.

        Raises what was given to ``fail``, or SimulationFailed for a vector that is not there.
        """
        self._failure, self._save, self._leader = None, save, leader
        leader.begin()
        try:
            self._run(deck)
        finally:
            leader.finish()
            self._leader = None

    def _run(self, deck: str) -> None:
        self.clear_output()
        try:
            # Not PySpice's load_circuit and run: they take any word on stderr, and any node
            # with "error" in its name, for a failure. What fails is known by what is missing.
            self._load(deck)
            if not self.poisoned:
                if self._leader is not None:
                    self._leader.loaded(self)
                self._library.ngSpice_Command(b"run")
            if self._failure is not None:
                raise self._failure
        finally:
            if not self.poisoned:
                for command in (b"destroy all", b"remcirc"):
                    self._library.ngSpice_Command(command)

    def _load(self, deck: str) -> None:
        given = deck.splitlines()
        if self._looser:
            given.insert(-1, f".options {LOOSER}")
        lines = [_ffi.new("char[]", line.encode()) for line in (*given, "")]
        self._library.ngSpice_Circ(_ffi.new("char *[]", [*lines, _ffi.NULL]))

    def address(self, function: str) -> int:
        """Where compiled code finds one of the library's functions."""
        return int(_ffi.cast("uintptr_t", getattr(self._library, function)))

    def ask(self, device: str) -> list[float]:
        """The values of a device's parameter, ``@v1[pulse]``; none where it has no such one."""
        found = self._library.ngGet_Vec_Info(device.encode())
        values: list[float] = []
        if found != _ffi.NULL and found.v_realdata != _ffi.NULL:
            values = [float(found.v_realdata[k]) for k in range(found.v_length)]
            self._library.ngSpice_Command(f"unlet {device}".encode())
        return values

    def said(self) -> str:
        """ngspice's own words of trouble, as the end of a message."""
        words = [" ".join(word.split()) for word in (*self._stderr, *self._stdout)]
        if match := next(filter(None, map(_SINGULAR.search, words)), None):
            return (
                f"nothing determines the voltage at {match[1]} (its matrix is singular); "
                "look for a missing connection, or give it a resistor to ground, 1e9 ohm say"
            )
        telling = [word for word in words if _TROUBLE.search(word) and not _NOISE.search(word)]
        return "; ".join(dict.fromkeys(telling[:4])).rstrip(".!") or "it gave no reason"

    @property
    def too_small(self) -> bool:
        """It ended its last run since no step was small enough for its tolerances."""
        return any("imestep too small" in word for word in (*self._stderr, *self._stdout))

    @contextmanager
    def looser(self) -> Iterator[None]:
        """Runs with the absolute tolerances ``LOOSER``, whatever the netlist has."""
        self._looser = True
        try:
            yield
        finally:
            self._looser = False

    def ignored(self) -> list[str]:
        """The models' parameters that it does not know."""
        said = "\n".join((*self._stderr, *self._stdout))
        return [*dict.fromkeys(re.findall(r"unrecognized parameter \((\w+)\)", said))]

    def fail(self, failure: BaseException) -> None:
        """Make ngspice give up; ``run`` raises ``failure`` then. An exception cannot pass C."""
        if self._failure is None:
            self._failure = failure
        if self._leader is not None:
            self._leader.stop()

    @staticmethod
    def _exit(
        exit_status: int, immediate_unloding: bool, quit_exit: bool, ngspice_id: int, user_data: Any
    ) -> int:
        Engine.poisoned = True
        retire()
        return exit_status

    @staticmethod
    def _send_init_data(data: Any, ngspice_id: int, user_data: Any) -> int:
        self = _ffi.from_handle(user_data)
        try:
            names = [_ffi.string(data.vecs[i].vecname).decode() for i in range(data.veccount)]
            self.sent = tuple(name.lower() for name in names)
            if self._leader is not None:
                wanted = [sent(name.lower()).lower() for name in self._save]
                for name, vector in zip(self._save, wanted, strict=True):
                    if vector not in self.sent:
                        raise ValueError(plain(name))
                self._leader.places[:] = [self.sent.index(name) for name in (*wanted, "time")]
        except ValueError as error:
            self.fail(SimulationFailed(f"The netlist has no such vector: {error}."))
        return 0
