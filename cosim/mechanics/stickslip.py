"""The mechanical participant: the FMU with the scene's parameters.

Names of parameters and outputs are those of ``fmu/src/physics/variables.def``. The input is linear
within a step: its value at the start and its slope are set before each step. It is the current of
one coil (A) or, where the FMU has the current source too (circuit.model "limited"), the command
(V).
"""

from collections.abc import Sequence
from ctypes import c_double, c_int
from typing import Any

from cosim.errors import SimulationFailed
from cosim.mechanics.fmi import borrow, give_back, places
from cosim.mechanics.normal_force import normal_force
from cosim.scene import Scene, keys

STEP_OUTPUTS = (
    "back_emf",
    "back_emf_slope",
    "a_surface_max",
    "a_surface_min",
    "v_surface_max",
    "v_surface_min",
    "z_surface_max",
    "z_surface_min",
)
"""What is read after every step: back-EMF of one coil (V, V/s), extremes within the step."""

SAMPLE_OUTPUTS = (
    "back_emf",
    "z_surface",
    "v_surface",
    "a_surface",
    "z_ram",
    "v_ram",
    "z_part",
    "v_part",
    "friction_force",
)
"""What a row of the waveforms takes, SI; ``sticking`` follows them."""

SECOND_SAMPLE_OUTPUTS = (
    "back_emf_2",
    "z_surface_2",
    "v_surface_2",
    "a_surface_2",
    "z_ram_2",
    "v_ram_2",
    "friction_force_2",
)
"""What a row takes besides where a second surface moves by itself; ``sticking_2`` ends the row."""

TOTALS = (
    "z_part",
    "stick_time",
    "energy_in",
    "energy_friction",
    "energy_impact",
    "energy_damping",
    "energy_stored",
)
SOURCE_STEP_OUTPUTS = ("coil_current_max", "coil_current_min")
"""What is read besides after every step where the source is in the FMU: one coil's, A."""

SOURCE_SAMPLE_OUTPUTS = ("coil_current", "coil_voltage")
"""What a row takes besides then: current of one coil (A) and voltage across the coils (V)."""

SECOND_SOURCE_SAMPLE_OUTPUTS = ("coil_current_2", "coil_voltage_2")

SOURCE_TOTALS = (
    "output_high_time",
    "output_low_time",
    "current_limit_time",
    "energy_output",
    "energy_copper",
    "energy_magnetic",
)

COUNTERS = ("impacts", "stick_slip_events", "internal_steps", "internal_rejected")

CONTACT_LAWS = {"compliant": 1, "rigid": 2}


class Mechanics:
    """One instance of the FMU, initialised in static equilibrium at time 0 without current."""

    def __init__(self, scene: Scene, fmi_version: int = 3) -> None:
        self.time = 0.0
        """Time that the mechanics have reached, s."""
        self.steps = 0
        """Number of steps so far."""
        self._fmi_version = fmi_version
        self._fmi = borrow(fmi_version)
        self.has_source = scene.rung.source_in_fmu
        """Whether the input is the command of the FMU's own source, V, and not a current, A."""
        step_outputs, sampled, self.total_names = STEP_OUTPUTS, SAMPLE_OUTPUTS, TOTALS
        if self.has_source:
            step_outputs += SOURCE_STEP_OUTPUTS
            sampled += SOURCE_SAMPLE_OUTPUTS
            self.total_names += SOURCE_TOTALS
        self.has_second = scene.drive.phase_deg is not None
        """Whether a second surface moves by itself."""
        integers_sampled = ("sticking",)
        if self.has_second:
            sampled += SECOND_SAMPLE_OUTPUTS
            sampled += SECOND_SOURCE_SAMPLE_OUTPUTS if self.has_source else ()
            integers_sampled += ("sticking_2",)
            self.total_names += ("stick_time_2",)
        given = "command" if self.has_source else "current"
        self._input_places = places(fmi_version, (given, f"{given}_slope"))
        self._input = (c_double * 2)()
        self._second_places = places(fmi_version, (f"{given}_2", f"{given}_2_slope"))
        self._step_places = places(fmi_version, step_outputs)
        self.step_outputs = (c_double * len(step_outputs))()
        """Values of STEP_OUTPUTS, and SOURCE_STEP_OUTPUTS, after the last step."""
        self.columns = (*sampled, *integers_sampled)
        """Names of what ``sample`` gives."""
        self._sample_places = places(fmi_version, sampled)
        self._sample = (c_double * len(sampled))()
        self._sticking_places = places(fmi_version, integers_sampled)
        self._sticking = (c_int * len(integers_sampled))()
        self._totals_places = places(fmi_version, self.total_names)
        self._counters_places = places(fmi_version, COUNTERS)
        self._slope_place = places(fmi_version, ("back_emf_slope",))
        self._current_place = places(fmi_version, ("current",))
        self._gain = (c_double * 1)()
        self.normal_force = normal_force(scene)
        """The normal force where it changes in time."""
        self._force_places = places(fmi_version, ("normal_force", "normal_force_slope"))
        self._force = (c_double * 2)()
        reals, integers = parameters(scene)
        if self.normal_force is not None:
            reals["normal_force"] = self.normal_force.value(0.0)
        try:
            self._fmi.set_reals(
                places(fmi_version, tuple(reals)), (c_double * len(reals))(*reals.values())
            )
            self._fmi.set_integers(
                places(fmi_version, tuple(integers)), (c_int * len(integers))(*integers.values())
            )
            self._fmi.initialise()
            self._fmi.get_reals(self._step_places, self.step_outputs)
        except Exception as error:
            self._fmi.close()
            raise self.failed(error) from error

    def step_to(self, time: float, value: float = 0.0, slope: float = 0.0) -> None:
        """Advance to ``time`` (s) with the input (A or V) at the start and its slope (per s).

        The normal force must have no corner within the step.
        Raises SimulationFailed with the FMU's sentence.
        """
        self._input[0] = value
        self._input[1] = slope
        try:
            self._fmi.set_reals(self._input_places, self._input)
            if self.normal_force is not None:
                force, end = (
                    self.normal_force.value(self.time),
                    self.normal_force.value_before(time),
                )
                self._force[0], self._force[1] = force, (end - force) / (time - self.time)
                self._fmi.set_reals(self._force_places, self._force)
            self._fmi.do_step(self.time, time - self.time)
            self._fmi.get_reals(self._step_places, self.step_outputs)
        except Exception as error:
            raise self.failed(error) from error
        self.time = time
        self.steps += 1

    def give_second(self, value: float, slope: float) -> None:
        """The second surface's input (A or V) now, and its slope (per s) until given again."""
        try:
            self._fmi.set_reals(self._second_places, (c_double * 2)(value, slope))
        except Exception as error:
            raise self.failed(error) from error

    def sample(self) -> Sequence[float]:
        """Values of ``columns`` now; sticking is 1, slipping 0."""
        self._fmi.get_reals(self._sample_places, self._sample)
        self._fmi.get_integers(self._sticking_places, self._sticking)
        return [*self._sample, *self._sticking]

    def totals(self) -> dict[str, float]:
        """Values of TOTALS (and SOURCE_TOTALS) and COUNTERS now, counted from the start."""
        reals = (c_double * len(self.total_names))()
        self._fmi.get_reals(self._totals_places, reals)
        integers = (c_int * len(COUNTERS))()
        self._fmi.get_integers(self._counters_places, integers)
        return dict(zip((*self.total_names, *COUNTERS), (*reals, *integers), strict=True))

    def shared(self) -> dict[str, Any]:
        """What compiled code needs to step and read this instance, as fields of
        :class:`cosim.coupling.loop.compiled.Fmu`; it must not outlive it.
        """
        return {
            **self._fmi.addresses(),
            "version": self._fmi_version,
            "input_places": self._input_places,
            "step_places": self._step_places,
            "sample_places": self._sample_places,
            "sticking_place": self._sticking_places,
            "total_places": self._totals_places,
            "counter_places": self._counters_places,
            "inputs": len(self._input_places),
            "step_outputs_count": len(self.step_outputs),
            "samples": len(self._sample),
            "totals": len(self.total_names),
            "counters": len(COUNTERS),
            "step_outputs": self.step_outputs,
            "time": self.time,
            "steps": self.steps,
        }

    def refresh(self, current: float, slope: float = 0.0) -> None:
        """Calculate the outputs anew with this current (A, A/s), which the last step did not end
        with."""
        self._input[0], self._input[1] = current, slope
        try:
            self._fmi.set_reals(self._input_places, self._input)
            self._fmi.get_reals(self._step_places, self.step_outputs)
        except Exception as error:
            raise self.failed(error) from error

    def gain(self) -> float:
        """d(back-EMF slope)/d(current) now, V/(A s): Bl² over the mass that the coil feels, as the
        part sticks or slips and the ram is free or rests on a wall."""
        try:
            self._fmi.derivative(self._slope_place, self._current_place, self._gain)
        except Exception as error:
            raise self.failed(error) from error
        return self._gain[0]

    def close(self) -> None:
        """End the use of the instance."""
        give_back(self._fmi_version, self._fmi)

    def failed(self, error: Exception) -> SimulationFailed:
        """The failure to raise for a call of the FMU that gave ``error``, in the FMU's words."""
        said = self._fmi.messages[-1] if self._fmi.messages else str(error)
        return SimulationFailed(f"The mechanics failed at t = {self.time:.6g} s: {said}")


def parameters(scene: Scene) -> tuple[dict[str, float], dict[str, int]]:
    """Real and integer parameters of the FMU, with the scene's normal force."""
    reals: dict[str, float] = {}
    integers = {
        "contact": CONTACT_LAWS[scene.mechanics.contact],
        "ram_fixed": int(scene.mechanics.actuator == "direct"),
        "independent": int(scene.drive.phase_deg is not None),
        "source": int(scene.rung.source_in_fmu),
    }
    for key in keys():
        if key.variable and (value := getattr(getattr(scene, key.table), key.name)) is not None:
            (integers if key.kind is int else reals)[key.variable] = value
    if scene.rung.source_in_fmu:
        circuit = scene.circuit
        reals["output_high"] = circuit.supply - circuit.swing_loss_high
        reals["output_low"] = circuit.swing_loss_low - circuit.supply
    return reals, integers
