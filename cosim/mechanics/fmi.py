"""The FMU's calls under FMI 2.0 and FMI 3.0, alike for the caller, without copies of their arrays.

Both go through fmpy's own functions, which check every return code.
"""

from collections.abc import Iterable
from ctypes import CFUNCTYPE, byref, c_char_p, c_double, c_int, c_uint, c_void_p, cast
from functools import cache
from typing import Any, Protocol

import fmpy
from fmpy import fmi2, fmi3

from cosim.errors import BadInput
from cosim.mechanics.package import MODEL, token, unpacked


class Interface(Protocol):
    """One instance of the FMU. Places and values are ctypes arrays of equal length."""

    version: int
    """Of FMI."""
    messages: list[str]
    """What the FMU has said, the newest last."""

    def places(self, names: Iterable[str]) -> Any:
        """The value references of variables, as an array for the calls."""
        ...

    def initialise(self) -> None:
        """End the initialisation, in which parameters could be set."""
        ...

    def do_step(self, time: float, step: float) -> None:
        """Advance by ``step`` from ``time``, s."""
        ...

    def set_reals(self, places: Any, values: Any) -> None: ...
    def get_reals(self, places: Any, values: Any) -> None: ...
    def set_integers(self, places: Any, values: Any) -> None: ...
    def get_integers(self, places: Any, values: Any) -> None: ...

    def restart(self) -> None:
        """Back to the state after the making: parameters can be set again."""
        ...

    def derivative(self, unknown: Any, known: Any, result: Any) -> None:
        """Put d(outputs ``unknown``)/d(input ``known``) into ``result``; ``known`` is one place."""
        ...

    def get_state(self, handle: c_void_p) -> None:
        """Save the state into ``handle``: a null one is given memory, a used one is overwritten."""
        ...

    def set_state(self, handle: c_void_p) -> None:
        """Go back to a saved state."""
        ...

    def free_state(self, handle: c_void_p) -> None:
        """Free the memory of a saved state."""
        ...

    def addresses(self) -> dict[str, int]:
        """Where compiled code finds the instance and the five functions, by their names here."""
        ...

    def close(self) -> None:
        """Free the instance."""
        ...


@cache
def references(version: int) -> dict[str, int]:
    """Value reference of each variable."""
    description = fmpy.read_model_description(str(unpacked(version)), validate=False)
    return {v.name: v.valueReference for v in description.modelVariables}


def _addresses(fmu: Any, *functions: str) -> dict[str, int]:
    names = ("set_reals", "do_step", "get_reals", "get_integers")
    found = [cast(getattr(fmu.dll, function), c_void_p).value or 0 for function in functions]
    return {"instance": fmu.component, **dict(zip(names, found, strict=True))}


def _loaded(kind: Any, version: int) -> Any:
    folder = str(unpacked(version))
    try:
        return kind(
            instanceName="cosim", guid=token(), modelIdentifier=MODEL, unzipDirectory=folder
        )
    except Exception as error:
        raise BadInput(f"The FMU in {folder} cannot be loaded: {error}") from error


class _Places:
    version: int

    def places(self, names: Iterable[str]) -> Any:
        known = references(self.version)
        found = [known[name] for name in names]
        return (c_uint * len(found))(*found)


class Fmi2(_Places):
    """The FMU through FMI 2.0 for co-simulation."""

    version = 2

    def __init__(self) -> None:
        self.messages: list[str] = []
        self._running = False
        self._fmu = _loaded(fmi2.FMU2Slave, 2)
        self._logger = _LOGGER_2(lambda *a: self.messages.append(_text(a[4])))
        callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = self._logger
        callbacks.allocateMemory = fmi2.defaultCallbacks.allocateMemory
        callbacks.freeMemory = fmi2.defaultCallbacks.freeMemory
        self._fmu.instantiate(callbacks=callbacks)
        self._begin()
        self._component = self._fmu.component

    def _begin(self) -> None:
        self._fmu.setupExperiment()
        self._fmu.enterInitializationMode()

    def restart(self) -> None:
        self._fmu.reset()
        self._running = False
        self.messages.clear()
        self._begin()

    def initialise(self) -> None:
        self._fmu.exitInitializationMode()
        self._running = True

    def do_step(self, time: float, step: float) -> None:
        self._fmu.fmi2DoStep(self._component, time, step, 1)

    def set_reals(self, places: Any, values: Any) -> None:
        self._fmu.fmi2SetReal(self._component, places, len(places), values)

    def get_reals(self, places: Any, values: Any) -> None:
        self._fmu.fmi2GetReal(self._component, places, len(places), values)

    def set_integers(self, places: Any, values: Any) -> None:
        self._fmu.fmi2SetInteger(self._component, places, len(places), values)

    def get_integers(self, places: Any, values: Any) -> None:
        self._fmu.fmi2GetInteger(self._component, places, len(places), values)

    def derivative(self, unknown: Any, known: Any, result: Any) -> None:
        self._fmu.fmi2GetDirectionalDerivative(
            self._component, unknown, len(unknown), known, 1, _ONE, result
        )

    def get_state(self, handle: c_void_p) -> None:
        self._fmu.fmi2GetFMUstate(self._component, byref(handle))

    def set_state(self, handle: c_void_p) -> None:
        self._fmu.fmi2SetFMUstate(self._component, handle)

    def free_state(self, handle: c_void_p) -> None:
        self._fmu.fmi2FreeFMUstate(self._component, byref(handle))

    def addresses(self) -> dict[str, int]:
        return _addresses(self._fmu, "fmi2SetReal", "fmi2DoStep", "fmi2GetReal", "fmi2GetInteger")

    def close(self) -> None:
        if self._running:
            self._fmu.terminate()
        self._fmu.freeInstance()


class Fmi3(_Places):
    """The FMU through FMI 3.0 for co-simulation."""

    version = 3

    def __init__(self) -> None:
        self.messages: list[str] = []
        self._running = False
        self._fmu = _loaded(fmi3.FMU3Slave, 3)
        self._logger = fmi3.fmi3LogMessageCallback(lambda *a: self.messages.append(_text(a[3])))
        self._fmu.instantiate(logMessage=self._logger)
        self._fmu.enterInitializationMode()
        self._component = self._fmu.component
        self._unused: Any = (*(byref(fmi3.fmi3Boolean()) for _ in range(3)), byref(c_double()))

    def restart(self) -> None:
        self._fmu.reset()
        self._running = False
        self.messages.clear()
        self._fmu.enterInitializationMode()

    def initialise(self) -> None:
        self._fmu.exitInitializationMode()
        self._running = True

    def do_step(self, time: float, step: float) -> None:
        self._fmu.fmi3DoStep(self._component, time, step, True, *self._unused)

    def set_reals(self, places: Any, values: Any) -> None:
        self._fmu.fmi3SetFloat64(self._component, places, len(places), values, len(values))

    def get_reals(self, places: Any, values: Any) -> None:
        self._fmu.fmi3GetFloat64(self._component, places, len(places), values, len(values))

    def set_integers(self, places: Any, values: Any) -> None:
        self._fmu.fmi3SetInt32(self._component, places, len(places), values, len(values))

    def get_integers(self, places: Any, values: Any) -> None:
        self._fmu.fmi3GetInt32(self._component, places, len(places), values, len(values))

    def derivative(self, unknown: Any, known: Any, result: Any) -> None:
        n = len(unknown)
        self._fmu.fmi3GetDirectionalDerivative(
            self._component, unknown, n, known, 1, _ONE, 1, result, n
        )

    def get_state(self, handle: c_void_p) -> None:
        self._fmu.fmi3GetFMUState(self._component, byref(handle))

    def set_state(self, handle: c_void_p) -> None:
        self._fmu.fmi3SetFMUState(self._component, handle)

    def free_state(self, handle: c_void_p) -> None:
        self._fmu.fmi3FreeFMUState(self._component, byref(handle))

    def addresses(self) -> dict[str, int]:
        names = ("fmi3SetFloat64", "fmi3DoStep", "fmi3GetFloat64", "fmi3GetInt32")
        return _addresses(self._fmu, *names)

    def close(self) -> None:
        if self._running:
            self._fmu.terminate()
        self._fmu.freeInstance()


_ONE = (c_double * 1)(1.0)
_LOGGER_2 = CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)
"""FMI 2.0's logger without its variable arguments: this FMU's messages use none."""


def _text(message: bytes | None) -> str:
    return (message or b"").decode(errors="replace")


INTERFACES: dict[int, type[Interface]] = {2: Fmi2, 3: Fmi3}

_idle: dict[int, Interface] = {}


def borrow(version: int) -> Interface:
    """An instance whose parameters can be set: the one that was given back last, or a new one.

    Making one takes as long as a tenth of a short run.
    """
    kept = _idle.pop(version, None)
    if kept is None:
        return INTERFACES[version]()
    kept.restart()
    return kept


def give_back(instance: Interface) -> None:
    """Keep a borrowed instance for the next run."""
    other = _idle.pop(instance.version, None)
    if other is not None:
        other.close()
    _idle[instance.version] = instance
