"""A signal ends a command, whatever swallows what it raises."""

import signal
import subprocess
import sys
import time

import pytest

from tests.helpers import needs

pytestmark = [pytest.mark.reliability, needs.posix]

DEAF = """
import time
from cosim.toolchain import interrupts
interrupts.GRACE = 1
with interrupts.ended_alike():
    print("ready", flush=True)
    while True:
        try:
            time.sleep(60.0)
        except KeyboardInterrupt:
            pass
"""

FREEING = """
import sys, time
from cosim.toolchain import interrupts
class Freed:
    def __del__(self):  # Python loses what is raised here
        print("ready", flush=True)
        time.sleep(60.0)
try:
    with interrupts.ended_alike():
        Freed()
        time.sleep(60.0)
except KeyboardInterrupt:
    print("ended")
"""

COMPILED = """
import time
import numpy
from scipy.stats import qmc
from cosim.toolchain import interrupts
def load(*_):  # called by a Cython function that cannot raise: it prints what is raised here
    print("ready", flush=True)
    time.sleep(60.0)
numpy.load = load
try:
    with interrupts.ended_alike():
        qmc.Sobol(2)
        time.sleep(60.0)
except KeyboardInterrupt:
    print("ended")
"""

DEAF_ONCE = """
import time
from cosim.toolchain import interrupts
try:
    with interrupts.ended_alike():
        try:
            print("ready", flush=True)
            time.sleep(60.0)
        except BaseException:  # as compiled code does that asks whether an object has an attribute
            pass
        time.sleep(60.0)
except KeyboardInterrupt:
    print("ended")
"""

TURNED = """
import time
from cosim.toolchain import interrupts
class Panic(BaseException):
    pass
try:
    with interrupts.ended_alike():
        try:
            print("ready", flush=True)
            time.sleep(60.0)
        except KeyboardInterrupt:  # as a library in Rust does while it loads
            raise Panic from None
except KeyboardInterrupt:
    print("ended")
"""

CLEANING = """
import time
from cosim.toolchain import interrupts
try:
    with interrupts.ended_alike():
        try:
            print("ready", flush=True)
            time.sleep(60.0)
        finally:
            time.sleep(1.5 * interrupts.AGAIN)
            try:
                {}["lacking"]
            except KeyError:  # as caches and imports handle it
                time.sleep(1.5 * interrupts.AGAIN)
            clean = True
except KeyboardInterrupt:
    assert clean
    time.sleep(2.0 * interrupts.AGAIN)
    print("ended")
"""

POLITE = """
import signal, time
from cosim.toolchain import interrupts
interrupts.GRACE = 1
try:
    with interrupts.ended_alike():
        print("ready", flush=True)
        time.sleep(60.0)
except KeyboardInterrupt:
    assert signal.alarm(0) == 0
    print("ended")
"""


def heed_all() -> None:
    """A background job ignores SIGINT, one under nohup SIGHUP, and so would their children."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
@pytest.mark.parametrize("program", [DEAF, DEAF_ONCE, FREEING, COMPILED, TURNED, CLEANING, POLITE])
def test_a_signal_ends_a_command_that_does_not_hear_it(program: str, number: int) -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=heed_all,
    )  # fmt: skip
    assert process.stdout is not None and process.stdout.readline() == "ready\n"
    time.sleep(0.1)
    process.send_signal(number)
    heard = process.communicate(timeout=30)
    if program is not DEAF:
        assert (process.returncode, *heard) == (0, "ended\n", "")
    else:
        assert process.returncode == -signal.SIGALRM
