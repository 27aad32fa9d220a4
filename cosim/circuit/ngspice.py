"""ngspice, led through PySpice: the library, its callbacks, and one run.

Order of calls within a transient run (ngspice 39): for each attempted step ``GetVSRCData`` at every
Newton iteration and then ``GetSyncData`` at location 1; for an accepted step ``SendData`` and then
``GetSyncData`` at location 0, where the next step may be shortened; it is missing after the last.

The library reads .spiceinit from the home and the working folder, and spinit from the folder that
SPICE_SCRIPTS names: for a worker all three are an empty folder.

Importing this module loads PySpice, which is slow: only workers import it.
"""

import logging
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from ctypes import addressof
from functools import cache
from typing import Any, ClassVar

from PySpice.Spice.NgSpice import Shared

from cosim.circuit.dialect.words import sent
from cosim.circuit.joined import Deck
from cosim.errors import BadInput, SimulationFailed, plain
from cosim.toolchain.libraries import library, ngspice_library
from cosim.toolchain.serving import retire

_ffi: Any = Shared.ffi

# PySpice warns of newer versions of ngspice, and of words on stderr that are no errors.
logging.getLogger(Shared.__name__).setLevel(logging.CRITICAL)


_TROUBLE = re.compile(
    r"error|too small|singular|converge|failed|abort|can.t|cannot|could not|unknown|undefined|not ",
    re.IGNORECASE,
)
_NOISE = re.compile(
    r"^Note|init|ngspice.dll|circuits? loaded|is ignored|No compatibility|@\w+\[pulse\]|"
    "no such device or model name",  # answers ``ask`` for the edges of a source
    re.IGNORECASE,
)
"""Output of ngspice that tells no reason: on itself, or a consequence of an earlier message."""


_SINGULAR = re.compile(r"singular matrix: check (nodes? \S+(?: and \S+)?)", re.IGNORECASE)

LOOSER = "abstol=1e-8 vntol=1e-5 chgtol=1e-11"
"""A, V, C. ngspice's defaults 1 pA, 1 uV and 10 fC are meant for integrated circuits: where amperes
are switched, no step is small enough for them."""


class Leader:
    """A run, for which the compiled callbacks act."""

    kind: ClassVar[str]
    """"lead" or "ports": its functions in the compiled loop are KIND_begin and KIND_finish."""
    state: Any
    """The structure that the callbacks take."""
    places: Any
    """ctypes array, to be filled: indices of the saved vectors, then of time, among those sent."""

    def begin(self) -> None:
        """The callbacks act for this run from now on."""
        getattr(library("loop"), f"{self.kind}_begin")(addressof(self.state))

    def finish(self) -> None:
        """The run has ended; the callbacks were not told of the end of the last step."""
        getattr(library("loop"), f"{self.kind}_finish")(addressof(self.state))

    def loaded(self, engine: "Engine") -> None:
        """The circuit is loaded, its run not yet begun."""

    def stop(self) -> None:
        """Make the run fail: the sources become NaN, so that no step succeeds."""
        self.state.stopped = 1


@cache
def engine(data: int, source: int, step: int) -> "Engine":
    """The process's one ngspice, which calls compiled functions at these addresses: SendData,
    GetVSRCData, GetSyncData; in Python these would take longer than ngspice itself. Raises BadInput
    where the library is missing.

    It loads no code models: ``dialect`` does without them, and they would cost 5 % of each run,
    since every step visits all kinds of elements.
    """
    name = ngspice_library()
    os.environ["SPICE_SCRIPTS"] = os.curdir  # not the installed spinit, which loads code models
    try:
        if os.sep in name and not os.path.isfile(name):  # opening a pipe would wait for ever
            raise OSError("there is no such file")
        return Engine(name, data, source, step)
    except (OSError, AttributeError) as error:  # the latter where it lacks ngspice's functions
        reason = str(error).partition("Additionally")[0].strip(" .")
        raise BadInput(
            f"{plain(name)}: this ngspice library cannot be loaded ({plain(reason)}); does "
            "NGSPICE_LIBRARY_PATH name it rightly?"
        ) from error


class Engine(Shared.NgSpiceShared):
    """The ngspice library with compiled callbacks: PySpice's create an object for every value."""

    sent: tuple[str, ...] = ()
    """The names of all vectors of the run, in the order in which ngspice sends them."""
    _looser = False
    poisoned = False
    """ngspice has asked to exit: its library in this process can run nothing any more."""

    def __init__(self, library: str, data: int, source: int, step: int) -> None:
        self.LIBRARY_PATH = library
        self._leader: Leader | None = None
        self._failure: BaseException | None = None
        self._save: tuple[str, ...] = ()
        self._data = data
        super().__init__(ngspice_id=0, send_data=True)
        self._library: Any = self._ngspice_shared
        # PySpice sets no GetSyncData; this second call sets it, and a compiled GetVSRCData.
        self._library.ngSpice_Init_Sync(
            _ffi.cast("GetVSRCData *", source),
            _ffi.cast("GetISRCData *", source),  # its arguments are those of GetVSRCData
            _ffi.cast("GetSyncData *", step),
            _ffi.NULL,
            self._self_c,
        )

    @property
    def _send_data_c(self) -> Any:
        """The SendData that PySpice hands to ngspice, once, when the library starts."""
        return _ffi.cast("SendData *", self._data)

    @_send_data_c.setter
    def _send_data_c(self, plain: Any) -> None:
        """Ignore PySpice's own callback."""

    def transient(self, deck: Deck, leader: Leader) -> None:
        """Run the transient analysis of ``deck``.

        Raises what was given to ``fail``, or SimulationFailed for a vector that is not there.
        """
        self._failure, self._save, self._leader = None, tuple(deck.vectors.values()), leader
        leader.begin()
        try:
            self._run(deck.text)
        finally:
            leader.finish()
            self._leader = None

    def _run(self, deck: str) -> None:
        self.clear_output()
        try:
            # Not PySpice's load_circuit and run: they take any word on stderr, and any node with
            # "error" in its name, for a failure. Here a run has failed if its end is missing.
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
        """The address of one of the library's functions, for compiled code."""
        return int(_ffi.cast("uintptr_t", getattr(self._library, function)))

    def ask(self, device: str) -> list[float]:
        """The values of a device's parameter such as ``@v1[pulse]``; none where it is missing."""
        found = self._library.ngGet_Vec_Info(device.encode())
        values: list[float] = []
        if found != _ffi.NULL and found.v_realdata != _ffi.NULL:
            values = [float(found.v_realdata[k]) for k in range(found.v_length)]
            self._library.ngSpice_Command(f"unlet {device}".encode())
        return values

    def said(self, begun: bool = False) -> str:
        """ngspice's messages of trouble in the last run, as the end of a sentence. In a run that
        had ``begun`` all nodes were determined at the operating point."""
        words = [" ".join(word.split()) for word in (*self._stderr, *self._stdout)]
        if match := next(filter(None, map(_SINGULAR.search, words)), None):
            if begun:
                return f"at {match[1]} its matrix became singular, as where a step is too long"
            return (
                f"nothing determines the voltage at {match[1]} (its matrix is singular); "
                "look for a missing connection, or give it a resistor to ground, 1e9 ohm say"
            )
        telling = [word for word in words if _TROUBLE.search(word) and not _NOISE.search(word)]
        return "; ".join(dict.fromkeys(telling[:4])).rstrip(".!") or "it gave no reason"

    @property
    def too_small(self) -> bool:
        """Whether the last run ended because no step was small enough for the tolerances."""
        return any("imestep too small" in word for word in (*self._stderr, *self._stdout))

    @contextmanager
    def looser(self) -> Iterator[None]:
        """Runs with the absolute tolerances ``LOOSER``, whatever the netlist has."""
        self._looser = True
        try:
            yield
        finally:
            self._looser = False

    def remarks(self) -> Iterator[str]:
        """Sentences on what ngspice has told of the last run: parameters of models that it does not
        know, and a start that is no operating point."""
        said = "\n".join((*self._stderr, *self._stdout))
        if unknown := dict.fromkeys(re.findall(r"unrecognized parameter \((\w+)\)", said)):
            yield f"ngspice knows no {', '.join(unknown)} of a model, and ignored it."
        if "Transient op finished" in said:
            yield (
                "ngspice found no operating point, as of a circuit that oscillates, and starts "
                "where 10 us of a transient have led; .ic or .nodeset in the netlist says where to "
                "start, run.settle leaves the beginning out."
            )

    def fail(self, failure: BaseException) -> None:
        """Make ngspice give up; :meth:`transient` then raises ``failure``, which cannot pass C."""
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
