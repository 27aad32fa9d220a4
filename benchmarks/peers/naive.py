"""A peer: PySpice's callbacks and fmpy's calls with lists, as their manuals show them.

After each accepted step PySpice passes every value as a Python object; the mechanics step with the
mean current, and the circuit keeps the back-EMF of the last step. It needs a process of its own,
since a process has one ngspice and ours has other callbacks.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from time import process_time
from typing import Any, Literal

import numpy as np
from fmpy import read_model_description
from fmpy.fmi3 import FMU3Slave
from PySpice.Spice.NgSpice.Shared import NgSpiceShared

from cosim.arrays import Array
from cosim.circuit.netlist import prepare
from cosim.coupling.ports.plan import Plan
from cosim.mechanics.fmi import references
from cosim.mechanics.package import MODEL, token, unpacked
from cosim.mechanics.stickslip import parameters
from cosim.scene import Scene
from cosim.toolchain.libraries import ngspice_library
from cosim.toolchain.processes import isolated

_FALL = 1e-9
"""s; time of the sawtooth's fall, which ngspice's own source wants above 0."""


def run(scene: Scene, times: Sequence[float]) -> tuple[float, Array]:
    """CPU seconds, and the part's height (m) at ``times`` (s)."""
    return isolated(partial(_run, times=times), scene, lambda _: None)


def run_motor(scene: Scene, times: Sequence[float]) -> tuple[float, Array]:
    """CPU seconds, and the speed (rad/s) of the scene `dc-motor` at ``times`` (s)."""
    return isolated(partial(_run_motor, times=times), scene, lambda _: None)


class Shared(NgSpiceShared):
    """ngspice with the two callbacks that PySpice means to be replaced.

    The FMU gets ``factor`` times the current (A) of the source Vemf in its variable ``into``; that
    source's voltage is ``factor`` times the first of ``outputs``; the last one is the path.
    """

    def __init__(self, into: int, outputs: list[int], factor: float = 1.0) -> None:
        self.LIBRARY_PATH = ngspice_library()
        self.inputs, self.outputs, self.factor = [into], outputs, factor
        super().__init__(send_data=True)

    def follow(self, fmu: FMU3Slave, deck: str) -> Array:
        """Run the deck from rest: times (s) and the path, as columns."""
        self.fmu = fmu
        self.time = self.current = self.emf = 0.0
        self.path: list[tuple[float, float]] = []
        self.load_circuit(deck)
        self.run()
        self.destroy()
        self.remove_circuit()
        fmu.freeInstance()
        return np.array(self.path).T

    def get_vsrc_data(self, voltage: Any, time: float, node: str, ngspice_id: int) -> Literal[0]:
        voltage[0] = self.emf
        return 0

    def send_data(
        self, actual_vector_values: dict[str, complex], number_of_vectors: int, ngspice_id: int
    ) -> Literal[0]:
        time = actual_vector_values["time"].real
        current = actual_vector_values["vemf#branch"].real
        if time > self.time:
            mean = 0.5 * (current + self.current)
            self.fmu.setFloat64(self.inputs, [self.factor * mean])
            self.fmu.doStep(self.time, time - self.time)
            values = self.fmu.getFloat64(self.outputs)
            self.emf = self.factor * values[0]
            self.path.append((time, values[-1]))
        self.time, self.current = time, current
        return 0


def _run(scene: Scene, _: Callable[[float], None], times: Sequence[float]) -> tuple[float, Array]:
    known, deck = references(3), _deck(scene)
    shared = Shared(known["current"], [known["back_emf"], known["z_part"]])
    began = process_time()
    reals, integers = ({known[name]: x for name, x in of.items()} for of in parameters(scene))
    fmu = _instance(unpacked(3), token(), MODEL, reals, integers)
    path = np.interp(times, *shared.follow(fmu, deck))
    return process_time() - began, path


def _run_motor(
    scene: Scene, _: Callable[[float], None], times: Sequence[float]
) -> tuple[float, Array]:
    (fmu,), (port, _probe) = scene.fmu, scene.port
    described = read_model_description(str(fmu.file), validate=False)
    known = {each.name: each.valueReference for each in described.modelVariables}
    shared = Shared(known["torque"], [known["speed"]], port.scale)
    began = process_time()
    given = {known[name]: value for name, value in fmu.parameters.items()}
    gear = _instance(Path(fmu.file), described.guid, Path(fmu.file).name, given, {})
    # Its own are not wanted, and all vectors are sent to Python.
    dropped = ("bcosim", ".save none")
    lines = [line for line in Plan(scene).deck().text.splitlines() if not line.startswith(dropped)]
    path = np.interp(times, *shared.follow(gear, "\n".join(lines)))
    return process_time() - began, path


def _instance(
    folder: Path, guid: Any, model: str, reals: Mapping[int, Any], integers: Mapping[int, Any]
) -> FMU3Slave:
    """An instance with these parameters, by their references."""
    fmu = FMU3Slave(
        guid=guid, unzipDirectory=str(folder), modelIdentifier=model, instanceName="peer"
    )
    fmu.instantiate()
    fmu.enterInitializationMode()
    fmu.setFloat64([*reals], [*reals.values()])
    fmu.setInt32([*integers], [*integers.values()])
    fmu.exitInitializationMode()
    return fmu


def _deck(scene: Scene) -> str:
    """The netlist with a sawtooth of ngspice's own."""
    drive, deck = scene.drive, prepare(scene).text
    low, high = (drive.offset + half * drive.amplitude for half in (-0.5, 0.5))
    rise = 1 / drive.frequency - 2 * _FALL
    pulse = f"PULSE({low!r} {high!r} 0 {rise!r} {_FALL} {_FALL} {1 / drive.frequency!r})"
    lines = deck.replace("vcommand v1 0 external", f"vcommand v1 0 {pulse}").splitlines()
    # As with our own command, all is at rest before it begins.
    return "\n".join(f"{line} uic" if line.startswith(".tran ") else line for line in lines)
