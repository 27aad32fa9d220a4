"""The tables of a scene: every key with its unit, default, range and meaning.

These models are the one place where a key is described; validation, error messages, the written
``scene.toml`` and the documentation all read it from here, through :func:`cosim.scene.keys`. All
values are SI.
"""

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

from cosim.scene import firmware


def _number(default: Any, unit: str, low: float, high: float, text: str) -> Any:
    """A number (float or int by its annotation) within ``low…high``."""
    extra: dict[str, Any] = {"unit": unit}
    return Field(default, ge=low, le=high, description=text, json_schema_extra=extra)


def _choice(default: Any, text: str) -> Any:
    return Field(default, description=text, json_schema_extra={"unit": ""})


def fault(sentence: str, *keys: str) -> PydanticCustomError:
    """A failed check between ``keys`` ("table.key"), told in a ``sentence`` without its dot."""
    return PydanticCustomError("check", "{sentence}", {"sentence": sentence, "keys": keys})


def _both_or_neither(table: str, values: BaseModel, *pair: str) -> None:
    missing = [key for key in pair if getattr(values, key) is None]
    if len(missing) == 1:
        (there,) = set(pair) - set(missing)
        raise fault(f"{table}.{there} needs {table}.{missing[0]} beside it", f"{table}.{there}")


def is_number(value: object) -> bool:
    """Whether a value that is not validated yet can be calculated with: no huge int, no NaN."""
    return isinstance(value, int | float) and not isinstance(value, bool) and -1e9 < value < 1e9


class Table(BaseModel):
    """A table of a scene: frozen, without unknown keys, numbers neither bool nor string."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


NORMAL_FORCES = ("normal_force", "normal_force_file")
"""The keys of ``[friction]`` of which each replaces the other."""

KNOBS = {"pot_max": "amplitude", "pot_frequency": "frequency", "pot_offset": "offset"}
"""The knobs of the device and the keys of ``[drive]`` that each replaces."""


class Drive(Table):
    """The command V1 at the power amplifier's input.

    Where a knob is given, ``amplitude``, ``frequency`` and ``offset`` hold what it stands for.
    """

    waveform: Literal["sawtooth", "sine", "square", "optimal", "quaid", "file"] = _choice(
        "sawtooth",
        "Shape of the command; optimal, quaid, file and, with circuit none, sine are velocities "
        "that the surface is given",
    )
    frequency: float = _number(
        20.0, "Hz", 0.01, 1e5, "Frequency; the staircase rounds its period up to whole 50 us steps"
    )
    amplitude: float = _number(8.0, "V", 0.0, 100.0, "Peak-to-peak voltage at V1")
    offset: float = _number(-1.2, "V", -100.0, 100.0, "Mean voltage at V1")
    reset_time: float = _number(
        0.0, "s", 0.0, 100.0, "Length of the sawtooth's linear fall, at the end of the period"
    )
    phase_deg: float | None = _number(
        None,
        "deg",
        0.0,
        360.0,
        "Lag of the second surface's command; where given, two surfaces move by themselves, each "
        "with a source and coil of its own",
    )
    acceleration_max: float = _number(
        98.1, "m/s2", 1e-3, 1e6, "Greatest acceleration of a given surface, optimal and quaid"
    )
    optimum: Literal["up", "down", "robust"] = _choice(
        "up",
        "Optimal waveform: fastest upwards or downwards, or the upward one whose part need not "
        "meet the surface at the period's very end",
    )
    velocity_amplitude: float = _number(
        0.1, "m/s", 0.0, 1e3, "Amplitude of a given surface's velocity, sine"
    )
    file: str | None = _choice(
        None, "Tracked trial or CSV with time and velocity that moves a given surface"
    )
    quantised: bool = _choice(
        False,
        "Firmware's staircase of 10-bit codes every 50 us; true for a sharp sawtooth "
        'with circuit.model = "full" unless given',
    )
    loop_time: float = _number(
        0.0,
        "s",
        0.0,
        1e-3,
        "Time of one pass of the firmware's loop, which lengthens the staircase's steps; "
        "0 makes each 50 us, the device needs about 22 us",
    )
    pwm_ripple: bool = _choice(
        False,
        "Offset pin as the 488.28 Hz PWM that it is, not as its mean; "
        'with circuit.model = "full" only',
    )
    pot_max: float | None = _number(
        None, "1", 0.0, 1.0, "Knob that sets the DAC's maximum, instead of amplitude"
    )
    pot_frequency: float | None = _number(
        None, "1", 0.0, 1.0, "Knob from 100 Hz at 0 down to 1 Hz at 1, instead of frequency"
    )
    pot_offset: float | None = _number(
        None, "1", 0.0, 1.0, "Knob that sets the offset pin, 0 to 3.3 V, instead of offset"
    )

    @model_validator(mode="before")
    @classmethod
    def _turn_knobs(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        data = dict(data)
        for knob, key in KNOBS.items():
            if data.get(knob) is not None and key in data:
                raise fault(
                    f"drive.{knob} and drive.{key} say the same thing twice; give one of them",
                    f"drive.{knob}",
                    f"drive.{key}",
                )

        def turned(knob: str) -> float | None:
            # anything else fails in the validation of the knob itself
            value = data.get(knob)
            return float(value) if is_number(value) and 0 <= value <= 1 else None

        if (pot := turned("pot_max")) is not None:
            data["amplitude"] = firmware.knob_amplitude(pot)
        if (pot := turned("pot_frequency")) is not None:
            data["frequency"] = firmware.knob_frequency(pot)
        amplitude = data.get("amplitude", cls.model_fields["amplitude"].default)
        if (pot := turned("pot_offset")) is not None and is_number(amplitude):
            data["offset"] = firmware.knob_offset(pot, amplitude)
        return data

    @model_validator(mode="after")
    def _check(self) -> "Drive":
        # The other way round is told when it is run, so that a scene can leave the file open.
        if self.file is not None and self.waveform != "file":
            raise fault(
                f'drive.file is for drive.waveform = "file", not for "{self.waveform}"',
                "drive.file",
                "drive.waveform",
            )
        if self.waveform != "sawtooth":
            for key in ("quantised", "reset_time", "loop_time", *KNOBS):
                if getattr(self, key):
                    raise fault(
                        f'drive.{key} is for drive.waveform = "sawtooth" only, '
                        f'not for "{self.waveform}"',
                        f"drive.{key}",
                        "drive.waveform",
                    )
        period = 1 / self.frequency
        # shorter than this the fall could not be told from a jump after hours of simulated time
        if self.reset_time and not 1e-9 <= self.reset_time < period:
            raise fault(
                f"drive.reset_time = {self.reset_time:g} s must be 0, or at least 1e-09 s and "
                f"below the period of {period:g} s at drive.frequency = {self.frequency:g} Hz",
                "drive.reset_time",
                "drive.frequency",
            )
        if self.quantised and self.reset_time:
            raise fault(
                f"drive.reset_time = {self.reset_time:g} s must be 0 with drive.quantised = true, "
                "whose reset is sharp",
                "drive.reset_time",
                "drive.quantised",
            )
        if self.loop_time and not (self.quantised and self.loop_time >= 5e-6):
            raise fault(
                f"drive.loop_time = {self.loop_time:g} s must be 0, or at least 5e-06 s with "
                "drive.quantised = true",
                "drive.loop_time",
                "drive.quantised",
            )
        if self.quantised and not 0.1 <= self.frequency <= 1e4:
            raise fault(
                f"drive.frequency = {self.frequency:g} Hz must be a number from 0.1 to 10000 Hz "
                "with drive.quantised = true",
                "drive.frequency",
                "drive.quantised",
            )
        return self


class Circuit(Table):
    """What turns V1 into current."""

    model: Literal["full", "amplifier", "limited", "ideal", "auto", "none", "file"] = _choice(
        "amplifier",
        "Schematic with its difference amplifier, behavioural current source, the same reduced to "
        "its limits and the coil, current = command, the cheapest of the last three within "
        "run.tolerance, no drive at all, or the netlist named in circuit.netlist",
    )
    netlist: str | None = _choice(None, "A netlist of one's own, seen from the scene's file")
    supply: float = _number(18.0, "V", 0.1, 1e3, "Supply voltage, both signs")
    sense_resistance: float = _number(
        4.0, "Ohm", 1e-3, 1e6, "Sense resistor: current = V1 / sense_resistance"
    )
    current_limit: float = _number(
        2.504, "A", 1e-3, 1e3, 'Current limit of the power amplifier; not in "amplifier"'
    )
    gain_bandwidth: float = _number(
        1e6, "Hz", 1e2, 1e12, "Gain-bandwidth product of the power amplifier"
    )
    open_loop_gain: float = _number(
        98.0, "dB", 20.0, 200.0, "Open-loop gain of the power amplifier"
    )
    slew_rate: float = _number(10e6, "V/s", 1e2, 1e12, "Slew rate of the power amplifier")
    swing_loss_high: float = _number(
        4.0,
        "V",
        0.0,
        1e3,
        "Output's least distance to the positive supply; \"full\" has the data sheet's instead",
    )
    swing_loss_low: float = _number(
        4.0,
        "V",
        0.0,
        1e3,
        "Output's least distance to the negative supply; \"full\" has the data sheet's instead",
    )
    output_resistance: float = _number(
        0.0, "Ohm", 0.0, 1e3, "Open-loop output resistance of the power amplifier"
    )
    snubber_resistance: float | None = _number(
        None, "Ohm", 1e-3, 1e6, "Resistance of a snubber from the output to ground"
    )
    snubber_capacitance: float | None = _number(
        None, "F", 1e-12, 1.0, "Capacitance in series with it; both or neither are given"
    )
    reltol: float = _number(1e-5, "1", 1e-9, 1e-2, "Relative tolerance of ngspice")
    max_step: float = _number(
        5e-5,
        "s",
        1e-9,
        1e-2,
        "Largest time step of ngspice; 2e-05 s with rigid walls or a netlist, unless given",
    )

    @model_validator(mode="after")
    def _check(self) -> "Circuit":
        swing = self.model in ("amplifier", "limited", "auto", "file")
        for key in ("swing_loss_high", "swing_loss_low"):
            if swing and (loss := getattr(self, key)) >= self.supply:
                raise fault(
                    f"circuit.{key} = {loss:g} V must be below circuit.supply = {self.supply:g} V",
                    f"circuit.{key}",
                    "circuit.supply",
                )
        _both_or_neither("circuit", self, "snubber_resistance", "snubber_capacitance")
        if (self.model == "file") != (self.netlist is not None):
            raise fault(
                'circuit.model = "file" and circuit.netlist must be given together',
                "circuit.netlist",
                "circuit.model",
            )
        return self


class Coil(Table):
    """The voice coil; all values are those of one coil."""

    resistance: float = _number(7.1, "Ohm", 1e-3, 1e6, "Resistance of one coil")
    inductance: float = _number(1.2e-3, "H", 1e-9, 1e3, "Inductance of one coil")
    eddy_inductance: float | None = _number(
        None, "H", 1e-9, 1e3, "Inductance of the eddy-current branch (LR2 model), in series"
    )
    eddy_resistance: float | None = _number(
        None, "Ohm", 1e-3, 1e6, "Resistance across eddy_inductance; both or neither are given"
    )
    force_factor: float = _number(0.6, "N/A", -1e3, 1e3, "Force factor Bl at the magnetic centre")
    b1: float = _number(0.0, "1/m", -1e6, 1e6, "Linear term of Bl(q) = Bl (1 + b1 q + b2 q^2)")
    b2: float = _number(0.0, "1/m2", -1e9, 1e9, "Quadratic term of Bl(q)")
    count: int = _number(1, "1", 1, 16, "Equal coils in parallel that share the current")

    @model_validator(mode="after")
    def _check(self) -> "Coil":
        _both_or_neither("coil", self, "eddy_inductance", "eddy_resistance")
        return self


class Mechanics(Table):
    """Surface, ram and part."""

    actuator: Literal["ram", "direct"] = _choice(
        "ram",
        "What the coil pushes off from: a free ram, or a magnet that stands on the ground; there "
        "suspension and walls hold the surface itself",
    )
    ram_mass: float = _number(0.004, "kg", 1e-9, 1e3, "Mass of the ram in the actuator")
    surface_mass: float = _number(
        0.0145, "kg", 1e-9, 1e3, "Mass of the surface: actuator body and platform"
    )
    part_mass: float = _number(
        0.009, "kg", 1e-9, 1e3, "Mass of the whole part, shared by n_surfaces"
    )
    flexure_stiffness: float = _number(560.0, "N/m", 1e-6, 1e12, "Stiffness, surface to ground")
    flexure_damping: float = _number(0.84, "N.s/m", 0.0, 1e9, "Damping, surface to ground")
    suspension_k1: float = _number(40.0, "N/m", 0.0, 1e12, "Linear stiffness, ram to surface")
    suspension_k2: float = _number(0.0, "N/m2", -1e15, 1e15, "Quadratic stiffness of the same")
    suspension_k3: float = _number(1.5e7, "N/m3", 0.0, 1e18, "Cubic stiffness of the same")
    suspension_damping: float = _number(0.02, "N.s/m", 0.0, 1e9, "Damping, ram to surface")
    travel: float = _number(1.9e-3, "m", 1e-9, 1e3, "Free travel of the ram to either wall")
    contact: Literal["compliant", "rigid"] = _choice(
        "compliant", "Law of the walls: Hunt-Crossley or instantaneous impacts"
    )
    restitution: float = _number(0.75, "1", 0.0, 1.0, "Newton restitution of the rigid walls")
    contact_stiffness: float = _number(
        1e8, "N/m1.5", 1.0, 1e15, "Stiffness K of the compliant walls"
    )
    contact_damping: float = _number(0.38, "s/m", 0.0, 1e6, "Damping lambda of the compliant walls")
    n_surfaces: int = _number(1, "1", 1, 16, "Surfaces that share the part; a gripper has 2")
    gravity: float = _number(9.81, "m/s2", 0.0, 1e4, "Acceleration of gravity, downwards")


class Friction(Table):
    """Friction on the part."""

    law: Literal["coulomb"] = _choice("coulomb", "Law of friction, exact in sticking")
    mu_s: float = _number(0.72, "1", 0.0, 1e3, "Static coefficient, surface on part")
    mu_k: float = _number(0.59, "1", 0.0, 1e3, "Kinetic coefficient, at most mu_s")
    normal_force: float = _number(0.5, "N", 0.0, 1e9, "Normal force of one surface on the part")
    normal_force_file: str | None = _choice(
        None,
        "CSV with time [s] and normal_force [N], linear in between, its first and last values kept "
        "before and after; instead of normal_force",
    )
    mu_plate: float = _number(0.0, "1", 0.0, 1e3, "Coefficient of the springed plate on the part")

    @model_validator(mode="before")
    @classmethod
    def _one_force(cls, data: Any) -> Any:
        if isinstance(data, dict) and None not in map(data.get, NORMAL_FORCES):
            one, other = (f"friction.{key}" for key in NORMAL_FORCES)
            raise fault(f"{one} and {other} say the same thing twice; give one of them", one, other)
        return data

    @model_validator(mode="after")
    def _check(self) -> "Friction":
        if self.mu_k > self.mu_s:
            raise fault(
                f"friction.mu_k = {self.mu_k:g} must be at most friction.mu_s = {self.mu_s:g}",
                "friction.mu_k",
                "friction.mu_s",
            )
        return self


class Coupling(Table):
    """How circuit and mechanics are joined; ngspice leads."""

    method: Literal[
        "step-locked", "jacobi", "gauss-seidel", "mean-current", "companion", "auto"
    ] = _choice(
        "step-locked",
        "Mechanics follow each accepted step of ngspice; or macro steps: both sides extrapolated, "
        "the mechanics fed the current's line or mean, or the circuit carrying their inertia; or "
        "the cheapest of these, and of ngspice's steps, that meets a tolerance",
    )
    macro_step: float = _number(1e-4, "s", 1e-7, 1e-2, "Macro step; ends early at command's jumps")
    order: int = _number(
        1, "1", 0, 2, "Order of extrapolation: held, with the true slope, parabola"
    )
    tolerance: float = _number(
        1e-3, "1", 1e-6, 0.5, "With auto: error of the part's height that is allowed, of its range"
    )

    @model_validator(mode="before")
    @classmethod
    def _refuse_repeating(cls, data: Any) -> Any:
        method = data.get("method") if isinstance(data, dict) else None
        if method in ("iterated", "error-controlled", "event-aware"):
            raise fault(
                f'coupling.method = "{method}" repeats steps, which ngspice cannot; it is for '
                "cosim.coupling's other participants",
                "coupling.method",
            )
        return data


COUPLING_KEYS = {
    "step-locked": {"method"},
    "jacobi": {"method", "macro_step", "order"},
    "gauss-seidel": {"method", "macro_step", "order"},
    "mean-current": {"method", "macro_step", "order"},
    "companion": {"method", "macro_step"},
    "auto": {"method", "tolerance"},
}
"""The keys of ``[coupling]`` that act with each ``coupling.method``."""

CHOSEN_BY_AUTO = ("reltol", "max_step")
"""The keys of ``[circuit]`` that ``coupling.method = "auto"`` chooses."""

GIVEN_SURFACES = {
    "optimal": {"frequency", "acceleration_max", "optimum"},
    "quaid": {"frequency", "acceleration_max", "optimum"},
    "sine": {"frequency", "velocity_amplitude"},
    "file": {"file"},
}
"""Waveforms of ``[drive]`` that, with circuit none, are the surface's velocity, and their keys."""

_OF_NGSPICE = set(Circuit.model_fields) - {"model"}
CIRCUIT_KEYS: dict[str, set[str]] = {
    "full": _OF_NGSPICE - {"swing_loss_high", "swing_loss_low"},
    "amplifier": _OF_NGSPICE - {"current_limit"},
    "limited": {"supply", "sense_resistance", "current_limit", "swing_loss_high", "swing_loss_low"},
    "ideal": {"sense_resistance"},
    "auto": _OF_NGSPICE,
    "none": set(),
    "file": _OF_NGSPICE,
}
"""The keys of ``[circuit]`` that act with each ``circuit.model``."""

WITHOUT_NGSPICE = ("limited", "ideal", "none")
"""Each ``circuit.model`` that starts no ngspice."""


LED = ("full", "amplifier", "file")
"""Values of ``circuit.model`` with which ngspice leads and there is something to couple."""


def acts(table: str, key: str, model: str, waveform: str, method: str = "step-locked") -> bool:
    """Whether a key does anything with this ``circuit.model``, ``drive.waveform`` and
    ``coupling.method``."""
    if key in ("model", "waveform"):
        return True
    if table == "coupling":
        return (model in LED or model == "auto") and key in COUPLING_KEYS[method]
    if (table, key) == ("run", "tolerance"):
        return model not in ("none", "file")  # which are no rungs to choose from
    if table == "circuit":
        steered = method == "auto" and key in CHOSEN_BY_AUTO
        return key in CIRCUIT_KEYS[model] and not steered
    if table == "coil":
        return model != "none" or key == "count"  # as many rams take part in the energies
    if table == "drive":
        if model == "none":
            return key in GIVEN_SURFACES.get(waveform, ())
        return key not in set().union(*GIVEN_SURFACES.values()) - {"frequency"}
    return True


MAX_ROWS = 20_000_000


class Run(Table):
    """What is simulated and written."""

    duration: float = _number(2.0, "s", 1e-6, 1e5, "Simulated time")
    settle: float = _number(
        1.0, "s", 0.0, 1e5, "Time left out of the averages; half of the duration unless given"
    )
    output_step: float = _number(5e-5, "s", 1e-9, 1e3, "Time between the rows of the waveforms")
    tolerance: float = _number(
        0.01,
        "1",
        1e-6,
        1.0,
        'Relative error of v_average that a simpler circuit may make: for circuit.model = "auto", '
        "and for the ladder",
    )

    @model_validator(mode="before")
    @classmethod
    def _settle(cls, data: Any) -> Any:
        if isinstance(data, dict) and "settle" not in data and is_number(data.get("duration")):
            return data | {"settle": data["duration"] / 2}
        return data

    @model_validator(mode="after")
    def _check(self) -> "Run":
        for key in ("settle", "output_step"):
            if (value := getattr(self, key)) >= self.duration:
                raise fault(
                    f"run.{key} = {value:g} s must be below run.duration = {self.duration:g} s",
                    f"run.{key}",
                    "run.duration",
                )
        if self.duration / self.output_step > MAX_ROWS:
            raise fault(
                f"run.output_step = {self.output_step:g} s makes more than {MAX_ROWS} rows in "
                f"run.duration = {self.duration:g} s; it must be at least "
                f"{self.duration / MAX_ROWS:g} s",
                "run.output_step",
                "run.duration",
            )
        return self


TABLES: dict[str, type[Table]] = {
    "drive": Drive,
    "circuit": Circuit,
    "coil": Coil,
    "mechanics": Mechanics,
    "friction": Friction,
    "coupling": Coupling,
    "run": Run,
}
