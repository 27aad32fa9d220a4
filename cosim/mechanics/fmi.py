"""The FMU's calls, the same for FMI 2.0 and FMI 3.0, without copies of arrays.

They go through fmpy's functions, which check every return code.
"""

from collections import deque
from collections.abc import Iterable
from contextlib import suppress
from copy import copy
from ctypes import byref, c_double, c_uint, c_void_p, cast
from functools import cache, cached_property, partialmethod
from itertools import count
from threading import Lock
from typing import Any
from weakref import WeakValueDictionary

import fmpy
from fmpy import fmi2, fmi3

from cosim.errors import BadInput
from cosim.mechanics.package import MODEL, token, unpacked

_FUNCTIONS = {
    "set_reals": ("fmi2SetReal", "fmi3SetFloat64"),
    "do_step": ("fmi2DoStep", "fmi3DoStep"),
    "get_reals": ("fmi2GetReal", "fmi3GetFloat64"),
    "get_integers": ("fmi2GetInteger", "fmi3GetInt32"),
    "set_integers": ("fmi2SetInteger", "fmi3SetInt32"),
    "derivative": ("fmi2GetDirectionalDerivative", "fmi3GetDirectionalDerivative"),
    "get_state": ("fmi2GetFMUstate", "fmi3GetFMUState"),
    "set_state": ("fmi2SetFMUstate", "fmi3SetFMUState"),
    "free_instance": ("fmi2FreeInstance", "fmi3FreeInstance"),
    "free_state": ("fmi2FreeFMUstate", "fmi3FreeFMUState"),
}
"""Names of functions in this module, in FMI 2.0 and in FMI 3.0."""

_COMPILED = ("set_reals", "do_step", "get_reals", "get_integers")


@cache
def references(version: int) -> dict[str, int]:
    """Value reference of each variable."""
    description = fmpy.read_model_description(str(unpacked(version)), validate=False)
    return {v.name: v.valueReference for v in description.modelVariables}


@cache
def _places(version: int, names: tuple[str, ...]) -> Any:
    known = references(version)
    return (c_uint * len(names))(*(known[name] for name in names))


def unit(variable: Any) -> str:
    """The unit of one of fmpy's variables: its own, or else that of its type, or else 1."""
    return variable.unit or (variable.declaredType and variable.declaredType.unit) or "1"


SLAVES: dict[int, Any] = {2: fmi2.FMU2Slave, 3: fmi3.FMU3Slave}
"""fmpy's class of an FMU for co-simulation, by the version of FMI."""

_STEP_ENDS: dict[int, tuple[Any, ...]] = {
    2: (1,),
    3: (True, *(byref(fmi3.fmi3Boolean()) for _ in range(3)), byref(c_double())),
}
"""The last arguments of do_step: FMI 3.0 returns four further values, which are not used."""


class Interface:
    """One instance of the FMU. Places and values are ctypes arrays of equal length."""

    def __init__(
        self, version: int, loaded: Any = None, messages: deque[str] | None = None
    ) -> None:
        """Instantiate an FMU that fmpy has ``loaded``, by default the project's own. Its messages
        go into ``messages``, also if the instantiation fails."""
        self.version = version
        """Of FMI, 2 or 3."""
        self.messages: deque[str] = deque(maxlen=100) if messages is None else messages
        """The FMU's messages, the newest last."""
        self._running = False
        self.raw = copy(load(version) if loaded is None else loaded)
        """fmpy's own object."""
        if version == 2:
            callbacks = fmi2.fmi2CallbackFunctions()
            callbacks.logger = _logger_2
            callbacks.componentEnvironment = next(_number)
            _said[callbacks.componentEnvironment] = self.messages
            with suppress(OSError):  # fmpy has none for every machine
                from fmpy.logging import addLoggerProxy

                addLoggerProxy(byref(callbacks))
            callbacks.allocateMemory = fmi2.defaultCallbacks.allocateMemory
            callbacks.freeMemory = fmi2.defaultCallbacks.freeMemory
            self.raw.instantiate(callbacks=callbacks)
        else:
            self._logger = fmi3.fmi3LogMessageCallback(lambda *a: self.messages.append(_text(a[3])))
            self.raw.instantiate(logMessage=self._logger)

    def _call(self, name: str, *arguments: Any) -> None:
        """Call one of _FUNCTIONS; a foreign FMU may lack functions that are never called."""
        function = getattr(self.raw, _FUNCTIONS[name][self.version - 2])
        function(self.raw.component, *arguments)

    def _exchange(self, name: str, places: Any, values: Any) -> None:
        count = (len(values),) if self.version == 3 else ()
        self._call(name, places, len(places), values, *count)

    def derivative(self, unknown: Any, known: Any, result: Any) -> None:
        """Put d(outputs ``unknown``)/d(input ``known``) into ``result``; ``known`` is one place."""
        n = len(unknown)
        rest = (_ONE, 1, result, n) if self.version == 3 else (_ONE, result)
        self._call("derivative", unknown, n, known, 1, *rest)

    def places(self, names: Iterable[str]) -> Any:
        """The value references of variables, as an array for the calls."""
        return _places(self.version, tuple(names))

    def restart(self) -> None:
        """Return to the state after the instantiation: parameters can be set again."""
        self.raw.reset()
        self._running = False
        self.messages.clear()

    def initialise(self) -> None:
        """Initialise it with the parameters and inputs set before: an FMU may use them as soon as
        it enters the initialisation mode."""
        if self.version == 2:
            self.raw.setupExperiment()
        self.raw.enterInitializationMode()
        self.raw.exitInitializationMode()
        self._running = True

    def do_step(self, time: float, step: float) -> None:
        """Advance by ``step`` from ``time``, s."""
        self._call("do_step", time, step, *_STEP_ENDS[self.version])

    set_reals = partialmethod(_exchange, "set_reals")
    get_reals = partialmethod(_exchange, "get_reals")
    set_integers = partialmethod(_exchange, "set_integers")
    get_integers = partialmethod(_exchange, "get_integers")

    def get_state(self, handle: c_void_p) -> None:
        """Save the state into ``handle``: a null one is given memory, a used one is overwritten."""
        self._call("get_state", byref(handle))

    def set_state(self, handle: c_void_p) -> None:
        """Go back to a saved state."""
        self._call("set_state", handle)

    def free_state(self, handle: c_void_p) -> None:
        """Free the memory of a saved state."""
        self._call("free_state", byref(handle))

    @cached_property
    def addresses(self) -> dict[str, int]:
        """Addresses of the instance and of four functions, for compiled code, by name."""
        names = {name: _FUNCTIONS[name][self.version - 2] for name in _COMPILED}
        found = {name: getattr(self.raw.dll, function) for name, function in names.items()}
        where = {name: cast(function, c_void_p).value or 0 for name, function in found.items()}
        return {"instance": self.raw.component, **where}

    def close(self) -> None:
        """Free the instance, but not by fmpy's own function, which also unloads the library."""
        if self._running:
            self.raw.terminate()
        self._call("free_instance")


_ONE = (c_double * 1)(1.0)
_number = count(1)
_said: WeakValueDictionary[int, deque[str]] = WeakValueDictionary()
"""The messages of each instance of FMI 2.0, by the number it was given as its environment."""


def _text(message: bytes | None) -> str:
    return (message or b"").decode(errors="replace")


@fmi2.fmi2CallbackLoggerTYPE
def _logger_2(environment: int | None, *said: Any) -> None:
    """FMI 2.0's logger without variable arguments: fmpy's C function, which calls it, has already
    put these into the message. That function calls the same logger for all instances of a process,
    so the environment tells which instance it is."""
    newest = max(_said, default=0)  # for FMUs that do not pass their environment on
    with suppress(KeyError):
        _said[environment or newest].append(_text(said[-1]))


_loading = Lock()
_loaded: dict[int, Any] = {}


def load(version: int) -> Any:
    """fmpy's object of the FMU, which each instance copies. Raises BadInput.

    fmpy changes the working directory of the process while it loads a library, which would affect
    other threads: so it is loaded once, and a caller with threads loads it before they start.
    """
    with _loading:
        if version not in _loaded:
            folder = str(unpacked(version))
            names = {"instanceName": "cosim", "guid": token(), "modelIdentifier": MODEL}
            try:
                _loaded[version] = SLAVES[version](**names, unzipDirectory=folder)
            except Exception as error:
                raise BadInput(f"The FMU in {folder} cannot be loaded: {error}") from error
        return _loaded[version]


_idle: dict[int, list[Interface]] = {version: [] for version in SLAVES}


def borrow(version: int) -> Interface:
    """An instance whose parameters can be set: one that was given back, or a new one.

    A new one takes as long as a tenth of a short run.
    """
    if not _idle[version]:
        return Interface(version)
    instance = _idle[version].pop()
    instance.restart()
    return instance


def give_back(instance: Interface) -> None:
    """Keep a borrowed instance for later runs; as many are kept as ever ran at the same time."""
    _idle[instance.version].append(instance)
