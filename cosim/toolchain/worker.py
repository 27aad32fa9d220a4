"""A worker process as its parent sees it: started, given a call, watched, and ended.

It imports its function by name, and is ended when it makes no progress. That is measured in CPU
time and in time awake, not by the wall clock: a machine that slept, or a process that was stopped,
has lost nothing.

It has a working folder of its own, and only those environment variables that its libraries need;
with :class:`Bounds` it runs in a fence. Untrusted code may run in a bounded worker and answer in
its name, so its messages are JSON, never a pickle, which could call anything here.
"""

import builtins
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from shutil import rmtree
from typing import Any
from weakref import finalize, ref

from cosim.errors import BadInput, SimulationFailed, StepTooSmall, plain, printable
from cosim.files.atomic import folder_of_ones_own
from cosim.files.reader import Refused
from cosim.files.spill import unpacked
from cosim.toolchain.threads import Progress

PATIENCE = 30.0
"""s of a worker's CPU time without progress, after which its simulation counts as hanging."""

STALLED = 300.0
"""s of this process awake without progress or CPU time reported by a worker, after which the worker
is given up. The machine may be the reason."""

CALLS = 250
"""Calls after which a process is replaced: so ngspice's memory leaks stay below some MB."""

MOST_SAID = 64 << 20
"""Most bytes of one message from a bounded process: waveforms are in a file, not in messages."""

PACKED = "__columns__"
"""The only key of a JSON object that stands for columns in a file."""

REPORT_EVERY = 0.1
"""s of wall time between two reports of progress."""

LEAP = 2.0
"""s that count at most between two readings of a clock; a longer gap is sleep."""

_KEPT = ("PATH", "LD_", "DYLD_", "PYTHON", "LANG", "LC_", "TZ", "SYSTEMROOT", "NGSPICE_LIBRARY")
"""Beginnings of the names of environment variables that a process is given."""

_PROGRAM = """
import signal, sys
for name in ("SIGINT", "SIGTERM", "SIGHUP"):  # they reach the whole group; the parent decides
    if hasattr(signal, name):
        signal.signal(getattr(signal, name), signal.SIG_IGN)
from multiprocessing import connection
pipe = getattr(connection, sys.argv[1])(int(sys.argv[2]))
sys.path[:] = pipe.recv()
from cosim.toolchain.serving import serve
serve(pipe)
"""

_SAID = "said"
"""The file in a process's own folder with its output, stderr included."""

living: dict[int, "ref[Worker]"] = {}
"""Workers by their ids. No WeakSet: an interrupt within its callback would be lost."""


class ProcessLost(SimulationFailed):
    """A process has died or stalled; its call need not be the reason."""


@dataclass(frozen=True)
class Bounds:
    """A fenced process's access beyond its libraries and its own folder."""

    reads: tuple[str, ...] = ()
    """Paths of files and folders."""
    inside: Path | None = None
    """The parent of its own folder, which also holds tapes of long runs; None: the system's."""
    library: str = ""
    """The path of libngspice, which a process may be unable to find."""
    first: Callable[[], object] | None = None
    """Called before the fence closes, to load libraries that read other files."""


class Worker:
    """A process that calls ``function(argument, progress)`` with one argument after another.

    ``function`` must be importable. It is sent once, as are the values that a partial binds. The
    process ends with its parent.
    """

    def __init__(
        self, function: Callable[[Any, Progress], Any], bounds: Bounds | None = None
    ) -> None:
        self.pipe, there = Pipe()
        inside = bounds.inside if bounds else None
        self.kind = function, bounds
        self.folder, lock = folder_of_ones_own(inside or Path(tempfile.gettempdir()))
        held: list[subprocess.Popen[Any]] = []
        self._remains = finalize(self, _clear, os.getpid(), held, self.folder)
        living[id(self)] = ref(self)
        try:
            self._process = _start(there, self.folder, lock, bounds.library if bounds else "")
        finally:
            there.close()
            os.close(lock)
        held.append(self._process)
        self.given, self.usable = 0, False
        self.began = False
        """Whether it has sent a message in this call; else its end is a failure to start."""
        self._rest()
        self._send([os.path.abspath(path) for path in sys.path])
        self._send(function)
        self._send(bounds)

    def call(self, argument: Any, progress: Progress, heed: Callable[[], None]) -> Any:
        """The function's result. Meanwhile ``progress`` is called with the time reached, and
        ``heed``, which may raise. Raises EOFError where the process has died, SimulationFailed
        where it hangs, or the function's exception; ``usable`` only after a result or BadInput."""
        self.given, self.began, self.usable = self.given + 1, False, False
        self._steps = False
        said: tuple[str, Any] | None = None
        self.lost = True
        """Whether the process has not reported itself ready again after its answer."""
        self._rest()
        self._send(argument)
        while self._spent < PATIENCE and self._waited < STALLED:
            heed()
            progress(self.reached)
            now = time.monotonic()
            self._waited += min(now - self.rested, LEAP)
            self.rested = now
            if not self.pipe.poll(REPORT_EVERY):
                continue
            try:
                kind, value = self._heard()
            except (OSError, EOFError) as error:  # after a senseless message it may still be alive
                self._process.kill()
                if said is None:
                    raise EOFError from error
                break
            self.began = True
            if kind == "progress":
                self._rest()
                self.reached, self._steps = value, True
            elif kind == "spent":
                self._spent = value
            elif kind == "retires":
                self.given = CALLS
            elif kind == "rests":
                self.lost = False
                break
            else:
                said = kind, value
        if said is not None:
            good, value = said[0] == "result", said[1]
            fit = self.given < CALLS and not self.lost
            self.usable = fit and (good or isinstance(value, BadInput))
            if good:
                return value
            raise value
        hangs = self._spent >= PATIENCE
        raise (SimulationFailed if hangs else ProcessLost)(
            f"The simulation hangs {self.when}: no step was finished in "
            f"{f'{PATIENCE:g} s of CPU time' if hangs else f'{STALLED:g} s'}. A netlist without a "
            "solution can do this to ngspice, and an FMU can do it itself."
        )

    def _heard(self) -> tuple[str, Any]:
        """The next message: its kind and value. Raises EOFError where the process has died, OSError
        also for a senseless message."""
        if self.kind[1] is None:
            return self.pipe.recv()
        try:
            kind, value = json.loads(self.pipe.recv_bytes(MOST_SAID), object_hook=self._columns)
            if kind in ("progress", "spent"):
                return kind, float(value)
            return kind, _error(*value) if kind == "failure" else _printable(value)
        except (ValueError, TypeError, OverflowError, RecursionError) as error:
            raise OSError from error

    def _columns(self, found: dict[str, Any]) -> Any:
        return unpacked(self.folder, *found[PACKED]) if set(found) == {PACKED} else found

    def _rest(self) -> None:
        self.reached = 0.0
        """The latest progress of the call at hand, s of simulated time."""
        self._spent = self._waited = 0.0
        """s of its CPU time, and s of this process awake, since its last progress."""
        self.rested = time.monotonic()

    @property
    def when(self) -> str:
        """How far the call at hand has come, in words."""
        return f"after t = {self.reached:.6g} s" if self._steps else "before its first step"

    @property
    def alive(self) -> bool:
        return self._process.poll() is None

    def end(self, patience: float = 0.0) -> str:
        """End the process, by SIGKILL after ``patience`` s, and tell how it ended: the signal or
        exit code, and its last line on stderr."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(patience)
        self._process.kill()
        code = self._process.wait()
        how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        with suppress(OSError):
            words = Path(self.folder, _SAID).read_text("utf-8", "replace").split("\n")
            how += "".join(f": {plain(word.strip())}" for word in words[-2:-1] if word.strip())
        self.let_go()
        self._remains()
        return how

    def let_go(self) -> None:
        """Close this process's ends of the worker's stdin and pipe."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self.pipe.close()

    def _send(self, message: Any) -> None:
        with suppress(OSError):  # where the process has died, which ``_heard`` reports
            self.pipe.send(message)


def _error(name: str, text: str) -> Exception:
    """An exception of a bounded process: one of this package or of Python, by its name."""
    ours = (BadInput, Refused, SimulationFailed, StepTooSmall)
    kind: Any = (vars(builtins) | {one.__name__: one for one in ours}).get(name)
    with suppress(TypeError):  # no class, or an exception that takes more than a text
        if issubclass(kind, Exception):
            return kind(_printable(text))
    return RuntimeError(_printable(f"{name}: {text}"))


def _printable(value: Any) -> Any:
    """The value with all texts in lists and objects made printable."""
    if isinstance(value, str):
        return printable(value)
    if isinstance(value, list):
        return [_printable(each) for each in value]
    if isinstance(value, dict):
        return {name: _printable(each) for name, each in value.items()}
    return value


def _clear(owner: int, processes: "list[subprocess.Popen[Any]]", folder: str) -> None:
    """Kill and remove a worker that is freed, or that its ``owner`` (no forked child) leaves."""
    if os.getpid() != owner:
        return
    for process in processes:
        process.kill()
        with suppress(KeyboardInterrupt):  # a second one, while the first one ends all this
            process.wait()
    rmtree(folder, ignore_errors=True)


def _start(pipe: Connection, folder: str, lock: int, library: str) -> "subprocess.Popen[Any]":
    """Start a process that serves ``pipe``, and whose stdin closes when this process ends."""
    handle = pipe.fileno()
    # A session of its own, as in a terminal's session it could type into the shell.
    options: dict[str, Any] = {"pass_fds": (handle, lock), "start_new_session": True}
    if sys.platform == "win32":
        os.set_handle_inheritable(handle, True)
        about = subprocess.STARTUPINFO(lpAttributeList={"handle_list": [handle]})
        options = {"startupinfo": about}
    environment = {name: value for name, value in os.environ.items() if name.startswith(_KEPT)}
    environment |= {"NGSPICE_LIBRARY_PATH": library} if library else {}
    environment |= dict.fromkeys(("HOME", "TMPDIR", "TEMP"), folder) | {"OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-P", "-c", _PROGRAM, type(pipe).__name__, str(handle)]
    options |= {"stdin": subprocess.PIPE, "cwd": folder, "env": environment}
    with open(os.path.join(folder, _SAID), "wb") as said:
        return subprocess.Popen(command, stdout=said, stderr=said, **options)
