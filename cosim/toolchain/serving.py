"""What runs in a worker process: calls, reports of progress, and answers."""

import json
import math
import os
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from multiprocessing.connection import Connection
from typing import Any

from cosim.files.spill import Packed
from cosim.toolchain import fence
from cosim.toolchain.processes import in_place
from cosim.toolchain.worker import LEAP, PACKED, REPORT_EVERY

_BEAT = 1.0  # s between two reports of the CPU time used

used: "deque[Callable[[], object]]" = deque()
"""Cleanup for after the answer to a call is sent, as untrusted code may end the process in it."""

_retires = False


def serve(pipe: Connection) -> None:
    """The worker's main loop until its parent ends: call the function, and send the answers."""
    function, bounds = pipe.recv(), pipe.recv()
    unfit: Exception | None = None
    if bounds is not None:
        try:
            if bounds.first is not None:
                bounds.first()
            fence.close(bounds.reads)  # before there are threads, which would stay outside
        except Exception as failure:
            unfit = failure
    threading.Thread(target=_end_with_parent, daemon=True).start()
    reports = _Reports(pipe.send if bounds is None else partial(_send_json, pipe))
    while True:
        try:
            argument = pipe.recv()
        except (EOFError, OSError):
            return
        reports.begin()
        try:
            if unfit is not None:
                raise unfit
            with in_place():
                answer = ("result", function(argument, reports.progress))
        except Exception as failure:
            told = (type(failure).__name__, str(failure))
            answer = ("failure", failure if bounds is None else told)
        if _retires:
            reports.send("retires", None)
        reports.send(*answer)
        end_used()
        reports.at_work.clear()
        reports.send("rests", None)


def end_used() -> None:
    """Call the cleanup that calls have left."""
    while used:
        used.popleft()()


def retire() -> None:
    """Have this process replaced after the current call, since its library is spoilt."""
    global _retires
    _retires = True


class _Reports:
    """Reports to the parent: progress, and the CPU time used since the last progress."""

    def __init__(self, tell: Callable[[tuple[str, Any]], None]) -> None:
        self._tell = tell
        self._alone = threading.Lock()
        self._told = time.monotonic()
        self._steps = 0
        self.at_work = threading.Event()
        threading.Thread(target=self._beat, daemon=True).start()

    def send(self, kind: str, value: Any) -> None:
        with self._alone:
            self._tell((kind, value))

    def begin(self) -> None:
        """A call begins; its first progress is sent at once."""
        self._told = -math.inf
        self.send("spent", 0.0)
        self.at_work.set()

    def progress(self, reached: float) -> None:
        self._steps += 1
        now = time.monotonic()
        if now - self._told >= REPORT_EVERY:
            self._told = now
            self.send("progress", reached)

    def _beat(self) -> None:
        with suppress(OSError):  # the parent has ended
            while self.at_work.wait():
                steps, spent, before = self._steps, 0.0, time.process_time()
                while self.at_work.is_set():
                    time.sleep(_BEAT)
                    now = time.process_time()
                    spent += min(now - before, LEAP)
                    before = now
                    if steps != self._steps:
                        steps, spent = self._steps, 0.0
                    elif self.at_work.is_set():
                        self.send("spent", spent)


def _send_json(pipe: Connection, said: tuple[str, Any]) -> None:
    pipe.send_bytes(json.dumps(said, default=_packed).encode())


def _packed(value: Any) -> dict[str, Any]:
    if isinstance(value, Packed):
        return {PACKED: value.told}
    raise TypeError(f"a bounded process cannot give a {type(value).__name__}")


def _end_with_parent() -> None:
    os.read(0, 1)  # stdin: its other end closes however the parent ends
    os._exit(1)
