"""Work in processes of their own, which may hang, crash or be spoilt without harm.

A netlist can make ngspice, one library a process, loop for ever, end the process, or refuse all
further work. multiprocessing and pebble run the caller's program again, which standard input and a
script without a main guard do not survive; pebble limits a call's whole time; loky loses all calls
with one process. Here a process knows its function by its module, and work without progress ends
it. No wall clock tells that: a machine that slept, or a process that was stopped, has lost nothing.
"""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any

from cosim.errors import SimulationFailed

PATIENCE = 30.0
"""s of a process's own CPU time without any progress after which its simulation hangs."""

STALLED = 300.0
"""s in which this process was awake, and another one neither worked nor made progress, after which
that one is given up. The machine may be the reason."""

ENDING = 30.0
"""s that a process has to end once its pipe is closed."""

_REPORT_EVERY = 0.1  # s of wall time
_BEAT = 1.0  # s between two reports of the CPU time used
_MOST = 2.0  # s that count between two looks at a clock; whatever is more, one of them slept

_PROGRAM = """
import signal, sys
for name in ("SIGINT", "SIGTERM", "SIGHUP"):  # they reach the whole group; the parent decides
    if hasattr(signal, name):
        signal.signal(getattr(signal, name), signal.SIG_IGN)
from multiprocessing import connection
pipe = getattr(connection, sys.argv[1])(int(sys.argv[2]))
sys.path[:] = pipe.recv()
from cosim.toolchain.processes import serve
serve(pipe)
"""

Progress = Callable[[float], None]


def processors() -> int:
    """How many this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


class Worker:
    """A process that calls ``function(argument, progress)`` with one argument after another.

    ``function`` must be importable, and travels once, as do the values that a partial binds.
    ``pipe`` is ready for :meth:`hear` when there is news. The process ends with its parent.
    """

    def __init__(self, function: Callable[[Any, Progress], Any]) -> None:
        self.pipe, there = Pipe()
        with there:
            self._process = _start(there)
        self.began = False
        """It has said something, so what ends it later is not its start."""
        self._rest()
        self._send(sys.path)
        self._send(function)

    def give(self, argument: Any) -> None:
        """Have the function called; what comes of it is heard later."""
        self._rest()
        self._send(argument)

    def _rest(self) -> None:
        self.reached = 0.0
        """The latest progress of the call at hand, s of simulated time."""
        self._spent = self._waited = 0.0
        """s of its CPU time, and s of this process awake, since then."""
        self._looked = time.monotonic()

    def hear(self) -> tuple[str, Any]:
        """The next message: ``("alive", None)``, ``("result", value)`` or ``("failure", error)``.

        Raises EOFError where the process has died.
        """
        try:
            kind, value = self.pipe.recv()
        except OSError as error:
            raise EOFError from error
        self.began = True
        if kind == "progress":
            self._rest()
            self.reached = value
        elif kind == "spent":
            self._spent = value
        else:
            return kind, value
        return "alive", None

    @property
    def hangs(self) -> bool:
        """It has worked for PATIENCE without progress."""
        return self._spent >= PATIENCE

    def stalls(self) -> bool:
        """It has waited for STALLED without progress; to be asked every second or so."""
        now = time.monotonic()
        self._waited += min(now - self._looked, _MOST)
        self._looked = now
        return self._waited >= STALLED

    def end(self, patience: float = 0.0) -> str:
        """The signal or exit code that ended the process: SIGKILL, after ``patience`` s."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(patience)
        self._process.kill()
        code = self._process.wait()
        assert self._process.stdin is not None
        self._process.stdin.close()
        self.pipe.close()
        return signal.Signals(-code).name if code < 0 else f"exit code {code}"

    def _send(self, message: Any) -> None:
        with suppress(OSError):  # of a process that has died: hear() tells it
            self.pipe.send(message)


def isolated(simulate: Callable[..., Any], scene: Any, progress: Progress, **options: Any) -> Any:
    """What ``simulate(scene, progress, **options)`` gives, from a fresh process.

    Raises what it raises there, or SimulationFailed where the process hangs or dies.
    """
    worker = Worker(partial(simulate, **options))
    try:
        worker.give(scene)
        while not (worker.hangs or worker.stalls()):
            if not worker.pipe.poll(_BEAT):
                continue
            kind, value = worker.hear()
            if kind == "result":
                return value
            if kind == "failure":
                raise value
            progress(worker.reached)
    except EOFError:
        how = worker.end(ENDING)
        raise SimulationFailed(
            f"The simulation's process died at t = {worker.reached:.6g} s ({how})."
        ) from None
    finally:
        worker.end()
    raise SimulationFailed(
        f"The simulation hangs at t = {worker.reached:.6g} s: no step was finished in "
        f"{f'{PATIENCE:g} s of CPU time' if worker.hangs else f'{STALLED:g} s'}. A netlist without "
        "a solution can do this to ngspice."
    )


def _start(pipe: Connection) -> "subprocess.Popen[Any]":
    """A process that serves the other end of ``pipe``, and whose input ends with this process."""
    handle = pipe.fileno()
    options: dict[str, Any] = {"pass_fds": (handle,)}
    if sys.platform == "win32":
        os.set_handle_inheritable(handle, True)
        about = subprocess.STARTUPINFO(lpAttributeList={"handle_list": [handle]})
        options = {"startupinfo": about}
    command = [sys.executable, "-P", "-c", _PROGRAM, type(pipe).__name__, str(handle)]
    return subprocess.Popen(command, stdin=subprocess.PIPE, **options)


def serve(pipe: Connection) -> None:
    """What the process does until its parent ends: it calls the function, and tells."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    reports = _Reports(pipe)
    function = pipe.recv()
    reports.send("progress", 0.0)
    while True:
        try:
            argument = pipe.recv()
        except (EOFError, OSError):
            return
        reports.at_work.set()
        try:
            answer = ("result", function(argument, reports.progress))
        except Exception as failure:
            answer = ("failure", failure)
        reports.at_work.clear()
        reports.send(*answer)


class _Reports:
    """Tells the parent of progress, and of the CPU time that was used without any."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe
        self._alone = threading.Lock()
        self._told = time.monotonic()
        self._steps = 0
        self.at_work = threading.Event()
        threading.Thread(target=self._beat, daemon=True).start()

    def send(self, kind: str, value: Any) -> None:
        with self._alone:
            self._pipe.send((kind, value))

    def progress(self, reached: float) -> None:
        self._steps += 1
        now = time.monotonic()
        if now - self._told >= _REPORT_EVERY:
            self._told = now
            self.send("progress", reached)

    def _beat(self) -> None:
        with suppress(OSError):  # the parent has ended
            while self.at_work.wait():
                steps, spent, before = self._steps, 0.0, time.process_time()
                while self.at_work.is_set():
                    time.sleep(_BEAT)
                    now = time.process_time()
                    spent += min(now - before, _MOST)
                    before = now
                    if steps != self._steps:
                        steps, spent = self._steps, 0.0
                    elif self.at_work.is_set():
                        self.send("spent", spent)


def _end_with_parent() -> None:
    os.read(0, 1)  # whose other end closes however the parent ends
    os._exit(1)
