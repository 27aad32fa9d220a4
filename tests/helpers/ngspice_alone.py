"""Loads and runs decks in plain ngspice, each in a process of its own, handed over as text.

As a script: the deck on standard input, ngspice's words on standard output.
"""

import ctypes
import ctypes.util
import os
import subprocess
import sys
from pathlib import Path

LIBRARY = os.environ.get("NGSPICE_LIBRARY_PATH") or ctypes.util.find_library("ngspice")


def run(deck: str | bytes, folder: Path, seconds: float = 60) -> str:
    """What ngspice says of ``deck`` loaded and run in ``folder``, then the time it reached."""
    data = deck.encode() if isinstance(deck, str) else deck
    done = subprocess.run(
        [sys.executable, __file__],
        input=data,
        cwd=folder,
        capture_output=True,
        timeout=seconds,
        env={**os.environ, "NGSPICE_LIBRARY_PATH": LIBRARY or "", "HOME": str(folder)},
    )
    return done.stdout.decode(errors="replace")


def main() -> None:
    ngspice = ctypes.CDLL(os.environ["NGSPICE_LIBRARY_PATH"])
    context = ctypes.c_void_p
    said_type = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_char_p, ctypes.c_int, context)
    exit_type = ctypes.CFUNCTYPE(
        ctypes.c_int, ctypes.c_int, ctypes.c_bool, ctypes.c_bool, ctypes.c_int, context
    )

    def say(text: bytes, _number: int, _context: int) -> int:
        print(text.decode(errors="replace"), flush=True)
        return 0

    def leave(status: int, *_others: object) -> int:
        print(f"ngspice gave up with status {status}", flush=True)
        os._exit(1)

    said, left = said_type(say), exit_type(leave)
    ngspice.ngSpice_Init(said, None, left, None, None, None, None)
    lines = sys.stdin.buffer.read().split(b"\n")
    array = (ctypes.c_char_p * (len(lines) + 1))(*[line for line in lines if line], None)
    ngspice.ngSpice_Circ(array)
    ngspice.ngSpice_Command(b"run")
    ngspice.ngSpice_Command(b"let finished = time[length(time)-1]")
    ngspice.ngSpice_Command(b"print finished")
    ngspice.ngSpice_Command(b"let final = vcommand#branch[length(time)-1]")
    ngspice.ngSpice_Command(b"print final")
    sys.stdout.flush()
    os._exit(0)


if __name__ == "__main__":
    main()
