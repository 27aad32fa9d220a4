"""The tables of a scene: every key with its SI unit, default, range and meaning.

Keys that are variables of the FMU take these from ``variables.def``, from which the FMU's
``modelDescription.xml`` is made, too.
"""

import re
from collections.abc import Mapping
from functools import cache
from itertools import pairwise
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator
from pydantic_core import PydanticCustomError

from cosim.files.resources import fmu_sources
from cosim.scene import firmware
from cosim.scene.rungs import METHODS, RUNGS, CouplingMethod, Rung

# KIND(name, "unit", start, least, greatest, "text"); some rows have no unit.
_ROW = re.compile(
    r'^(INT_)?(?:PARAMETER|TUNABLE|INPUT)\((\w+), (?:"(.*?)", )?(.*?), (.*?), (.*?), "(.*)"\)$',
    re.MULTILINE,
)


@cache
def _variables() -> dict[str, tuple[float | int, str, float, float, str]]:
    """By name of the FMU's parameters and inputs: start value (int for integer variables), unit,
    least and greatest value, meaning. Raises BadInput where the FMU's sources are missing."""
    source = next((fmu_sources() / "src").rglob("variables.def")).read_text(encoding="utf-8")
    return {
        name: (int(start) if whole else float(start), unit or "1", float(low), float(high), text)
        for whole, name, unit, start, low, high, text in _ROW.findall(source)
    }


def _number(default: Any, unit: str, low: float, high: float, text: str, variable: str = "") -> Any:
    """A number (float or int by its annotation) within ``low…high``."""
    extra: dict[str, Any] = {"unit": unit, "variable": variable}
    return Field(default, ge=low, le=high, description=text, json_schema_extra=extra)


def _of_fmu(name: str, least: float | None = None) -> Any:
    """A number that the FMU takes as its variable ``name``.

    Where ``least`` is given, the key is absent or at least that; the FMU takes 0 for absent.
    """
    start, unit, low, high, text = _variables()[name]
    if least is not None:
        return _number(None, unit, least, high, text, name)
    return _number(start, unit, low, high, text, name)


def _choice(default: Any, text: str, unit: str = "", words: str = "") -> Any:
    """A key of any type; ``words`` are its allowed values, where the type does not say them."""
    return Field(default, description=text, json_schema_extra={"unit": unit, "words": words})


def _declared(default: str, lead: str, registry: Mapping[str, Rung | CouplingMethod]) -> Any:
    """A name out of a registry."""
    text = "; ".join(f"{name}: {one.text}" for name, one in registry.items())
    extra: dict[str, Any] = {"unit": "", "enum": [*registry]}
    pattern = f"^({'|'.join(map(re.escape, registry))})$"
    return Field(default, pattern=pattern, description=f"{lead}; {text}", json_schema_extra=extra)


def fault(sentence: str, *unnamed: str) -> PydanticCustomError:
    """A failed check of the keys ("table.key") that ``sentence``, without its full stop, names.

    The message blames the last layer that gave any of these, or of the ``unnamed``, involved keys.
    """
    keys = [*re.findall(r"\b[a-z]+\.[a-z]\w*", sentence), *unnamed]
    return PydanticCustomError("check", "{sentence}", {"sentence": sentence, "keys": keys})


def said_twice(one: str, other: str) -> str:
    """What is wrong where both keys are given."""
    return f"{one} and {other} say the same thing twice; give one of them"


def _both_or_neither(table: str, values: BaseModel, *pair: str) -> None:
    missing = [key for key in pair if getattr(values, key) is None]
    if len(missing) == 1:
        (there,) = set(pair) - set(missing)
        raise fault(f"{table}.{there} needs {table}.{missing[0]} beside it")


def is_number(value: object) -> bool:
    """Whether an unvalidated value is a number of ordinary size: no huge int, no NaN."""
    return isinstance(value, int | float) and not isinstance(value, bool) and -1e9 < value < 1e9


class Table(BaseModel):
    """A table of a scene: frozen, without unknown keys, numbers neither bool nor string."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    @model_validator(mode="after")
    def _checked(self) -> Self:
        self._check()
        return self

    def _check(self) -> None:
        """Raise a :func:`fault` where keys do not go together."""


FRAME_RATE = 960.0
"""Frames per second of the published trials' camera."""

SHORTEST = 1e-9
"""s: the least time between ``settle`` or ``output_step`` and the duration."""

LONGEST_NAME = 63
"""Characters in the name of a source that a port feeds."""

PATHS = (("circuit", "netlist"), ("drive", "file"), ("friction", "normal_force_file"))
"""The keys that name files."""

NORMAL_FORCES = ("normal_force", "normal_force_file")
"""The keys of ``[friction]`` of which each replaces the other."""

KNOBS = {"pot_max": "amplitude", "pot_frequency": "frequency", "pot_offset": "offset"}
"""The knobs of the device and the keys of ``[drive]`` that each replaces."""

_Waveform = Literal[
    "sawtooth", "falling-sawtooth", "sine", "square", "steps", "pieces", "optimal", "quaid", "file"
]  # fmt: skip

MOST_CORNERS = 64
"""Most pairs of ``drive.table``."""

_Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
_Table = Annotated[list[_Pair], Field(min_length=1, max_length=MOST_CORNERS)]

COMMANDS = ("sawtooth", "falling-sawtooth", "sine", "square", "steps", "pieces")
"""Waveforms of ``[drive]`` that drive a coil."""

_SHAPES = {
    **dict.fromkeys(("quantised", *KNOBS), COMMANDS),
    **{"reset_time": COMMANDS[:2], "loop_time": COMMANDS[:1], "duty": ("square",)},
    "table": ("steps", "pieces"),
}
"""Keys of ``[drive]`` and the waveforms that they are for."""

CORNERS_APART = 1e-9
"""s: least distance of two corners; after hours of simulated time less rounds to a jump."""

LEVEL_KEY = re.compile(r"table\.([1-9]\d?)")
"""The level of a pair of ``drive.table``, the first being 1, as a key of its own."""


PARAM_KEY = re.compile(r"param\.[A-Za-z_]\w*")
"""A ``.param`` of a netlist as a key of its own, in ``[circuit]``."""


class Drive(Table):
    """The command V1 at the power amplifier's input.

    Where a knob is given, ``amplitude``, ``frequency`` and ``offset`` hold what it stands for.
    """

    waveform: _Waveform = _choice(
        "sawtooth",
        "Shape of the command; of the surface's velocity for optimal, quaid and file. steps holds "
        "the levels of table, pieces joins them by straight lines",
    )
    table: _Table | None = _choice(
        None,
        "Shape of steps and pieces: 1 to 64 pairs of phase, 0 to 1, and level, -0.5 to 0.5 about "
        "the offset; two pairs of one phase make a jump",
        words="a list of 1 to 64 pairs of numbers, [[phase, level], ...]",
    )
    duty: float = _number(0.5, "1", 0.0, 1.0, "Share of the period that the square wave is high")
    frequency: float = _number(
        20.0, "Hz", 0.01, 1e5, "Frequency; the staircase rounds its period up to whole 50 us steps"
    )
    amplitude: float = _number(8.0, "V", 0.0, 100.0, "Peak-to-peak voltage at V1")
    offset: float = _number(-1.2, "V", -100.0, 100.0, "Mean voltage at V1")
    reset_time: float = _number(
        0.0, "s", 0.0, 100.0, "Length of the sawtooth's linear reset, at the end of the period"
    )
    start_time: float = _number(
        0.0, "s", 0.0, 1e5, "When the drive is switched on; the command is 0 V before"
    )
    start_phase: float = _number(
        0.0, "1", 0.0, 1.0, "Share of the period that has gone by when the drive is switched on"
    )
    phase_deg: float | None = _number(
        None, "deg", 0.0, 360.0, "Lag of the second of two surfaces, each with its own source"
    )
    acceleration_max: float = _number(
        98.1, "m/s2", 1e-3, 1e6, "Greatest acceleration of the surface, optimal and quaid"
    )
    optimum: Literal["up", "down", "robust"] = _choice(
        "up", "Optimal waveform: fastest up, fastest down, or up with no exact meeting at the end"
    )
    velocity_amplitude: float = _number(
        0.1, "m/s", 0.0, 1e3, "Amplitude of the surface's velocity, sine with no coil"
    )
    file: str | None = _choice(
        None, "Tracked trial, or CSV with time and velocity, that prescribes the surface's motion"
    )
    quantised: bool = _choice(
        False,
        "Firmware's staircase of 10-bit codes every 50 us; full then takes 15 to 40 times as long",
    )
    loop_time: float = _number(
        0.0, "s", 0.0, 1e-3, "Pass of the firmware's loop, about 22 us; 0 makes steps of 50 us"
    )
    pwm_ripple: bool = _choice(
        False, "Offset pin as its 488.28 Hz PWM instead of the mean; in circuit full only"
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
                raise fault(said_twice(f"drive.{knob}", f"drive.{key}"))

        # Other values fail in the validation of the knob itself.
        pots = {k: data.get(k) for k in KNOBS if is_number(data.get(k)) and 0 <= data[k] <= 1}
        if "pot_max" in pots:
            data["amplitude"] = firmware.knob_amplitude(pots["pot_max"])
        if "pot_frequency" in pots:
            data["frequency"] = firmware.knob_frequency(pots["pot_frequency"])
        amplitude = data.get("amplitude", cls.model_fields["amplitude"].default)
        if "pot_offset" in pots and is_number(amplitude):
            data["offset"] = firmware.knob_offset(pots["pot_offset"], amplitude)
        return _with_levels(data)

    def _check(self) -> None:
        # A waveform "file" without a file is refused only when run: a scene may leave it open.
        if self.file is not None and self.waveform != "file":
            raise fault(f'drive.file is for drive.waveform = "file", not for "{self.waveform}"')
        for key, able in _SHAPES.items():
            given = getattr(self, key) != type(self).model_fields[key].default
            if given and self.waveform not in able:
                quoted = " or ".join(f'"{name}"' for name in able)
                raise fault(f'drive.{key} is for drive.waveform = {quoted}, not "{self.waveform}"')
        period = 1 / self.frequency
        if self.reset_time and not CORNERS_APART <= self.reset_time < period:
            raise fault(
                f"drive.reset_time = {self.reset_time:g} s must be 0, or at least "
                f"{CORNERS_APART:g} s and below the period of {period:g} s at drive.frequency = "
                f"{self.frequency:g} Hz"
            )
        if self.waveform in _SHAPES["table"]:
            self._check_table()
        plain = self.quantised and not self.reset_time
        if self.loop_time and not (plain and self.loop_time >= 5e-6):
            raise fault(
                f"drive.loop_time = {self.loop_time:g} s must be 0, or at least 5e-06 s with "
                "drive.quantised = true and drive.reset_time = 0"
            )
        if self.quantised and not 0.1 <= self.frequency <= 1e4:
            raise fault(
                f"drive.frequency = {self.frequency:g} Hz must be a number from 0.1 to 10000 Hz "
                "with drive.quantised = true"
            )

    def _check_table(self) -> None:
        if self.table is None:
            raise fault(f'drive.waveform = "{self.waveform}" needs drive.table')
        phases = [phase for phase, _ in self.table]
        sorted_ = phases == sorted(phases) and phases[0] >= 0.0 and phases[-1] <= 1.0
        if not (sorted_ and all(abs(level) <= 0.5 for _, level in self.table)):
            raise fault(
                "drive.table must have phases from 0 to 1 that do not fall, and levels from -0.5 "
                "to 0.5"
            )
        gaps = [q - p for p, q in pairwise([*phases, 1.0 + phases[0]]) if q > p]
        if min(gaps) < CORNERS_APART * self.frequency:
            raise fault(
                f"drive.table must have pairs of one phase, or at least {CORNERS_APART:g} s apart "
                f"at drive.frequency = {self.frequency:g} Hz"
            )


def _with_levels(data: dict[str, Any]) -> dict[str, Any]:
    """The keys of a drive, with single levels (``table.3``) moved into its table."""
    levels = {name: data.pop(name) for name in [*data] if LEVEL_KEY.fullmatch(name)}
    table = data.get("table")
    for name, value in levels.items():
        place = int(name.partition(".")[2]) - 1
        if not (isinstance(table, list) and place < len(table) and is_number(value)):
            raise fault(f"drive.{name} needs a number, and a drive.table with as many pairs")
        pair = table[place]
        new = [*pair[:1], value] if isinstance(pair, list) else pair
        table = [*table[:place], new, *table[place + 1 :]]
    return data | {"table": table} if levels else data


SECTION_SIGN = ("\u00a7", "_")
"""LTspice's sign between a part's kind and its name, and what reading of netlists makes of it."""


class Circuit(Table):
    """What turns V1 into current."""

    model: str = _declared("amplifier", "Circuit", RUNGS)
    netlist: str | None = _choice(None, "Path of the user's netlist, relative to the scene file")
    save: list[str] | None = _choice(
        None,
        "Vectors and expressions of the user's netlist that go into the waveforms",
        words='a list of texts such as ["v(out)", "v(a)*i(Va)"]',
    )
    param: dict[str, float] | None = _choice(
        None,
        "Values, SI, for .param lines of the user's netlist, by their names",
        words="a table of numbers, { R1 = 1.0 }",
    )
    supply: float = _number(18.0, "V", 0.1, 1e3, "Supply voltage, both signs")
    sense_resistance: float = _of_fmu("sense_resistance")
    current_limit: float = _of_fmu("current_limit")
    gain_bandwidth: float = _number(1e6, "Hz", 1e2, 1e12, "Gain-bandwidth product of the amplifier")
    open_loop_gain: float = _number(98.0, "dB", 20.0, 200.0, "Open-loop gain of the amplifier")
    slew_rate: float = _number(10e6, "V/s", 1e2, 1e12, "Slew rate of the power amplifier")
    swing_loss_high: float = _number(
        *(4.0, "V", 0.0, 1e3),
        "Supply minus highest output; full takes the data sheet's, 2.6 V at 1.3 A",
    )
    swing_loss_low: float = _number(
        *(4.0, "V", 0.0, 1e3),
        "Lowest output minus negative supply; full takes the data sheet's, 1.7 V at 1.3 A",
    )
    output_resistance: float = _number(
        0.0, "Ohm", 0.0, 1e3, "Open-loop output resistance of the power amplifier"
    )
    snubber_resistance: float | None = _number(
        None, "Ohm", 1e-3, 1e6, "Resistance of a snubber from the output to ground"
    )
    snubber_capacitance: float | None = _number(
        None, "F", 1e-12, 1.0, "Capacitance in series with snubber_resistance; give both or neither"
    )
    reltol: float = _number(
        3e-5, "1", 1e-9, 1e-2, "Relative tolerance of ngspice; 1e-05 by default with file"
    )
    max_step: float = _number(
        1.4e-4, "s", 1e-9, 1e-2, "Largest step of ngspice; 2e-05 by default with file"
    )

    @field_validator("save")
    @classmethod
    def _read(cls, words: list[str] | None) -> list[str] | None:
        return words and [each.replace(*SECTION_SIGN) for each in words]

    @model_validator(mode="before")
    @classmethod
    def _take_params(cls, data: Any) -> Any:
        """A ``.param`` may be given as a key of its own, as an override does."""
        if not isinstance(data, dict):
            return data
        given = {name: data[name] for name in data if PARAM_KEY.fullmatch(str(name))}
        known = data.get("param") or {}
        if not given or not isinstance(known, dict):
            return data
        own = {name.partition(".")[2]: value for name, value in given.items()}
        return {name: data[name] for name in data if name not in given} | {"param": known | own}

    def _check(self) -> None:
        rung = RUNGS[self.model]
        for key in ("swing_loss_high", "swing_loss_low"):
            if key in rung.keys and (loss := getattr(self, key)) >= self.supply:
                raise fault(
                    f"circuit.{key} = {loss:g} V must be below circuit.supply = {self.supply:g} V"
                )
        _both_or_neither("circuit", self, "snubber_resistance", "snubber_capacitance")
        if rung.own_netlist != (self.netlist is not None):
            raise fault('circuit.model = "file" and circuit.netlist must be given together')


class Coil(Table):
    """The voice coil; all values are those of one coil."""

    resistance: float = _of_fmu("coil_resistance")
    inductance: float = _of_fmu("inductance")
    eddy_inductance: float | None = _of_fmu("eddy_inductance", least=1e-9)
    eddy_resistance: float | None = _of_fmu("eddy_resistance", least=1e-3)
    force_factor: float = _of_fmu("force_factor")
    polarity: Literal[-1, 1] = _choice(
        1, "Sign of the force factor; -1 is the coil with its two wires exchanged", "1"
    )
    b1: float = _of_fmu("b1")
    b2: float = _of_fmu("b2")
    count: int = _of_fmu("coil_count")
    winding_to_body: float = _number(
        10.0, "K/W", 1e-3, 1e6, "Thermal resistance from winding to body; assumed, 5 to 20"
    )
    winding_capacity: float = _number(
        0.75, "J/K", 1e-6, 1e6, "Heat capacity of the winding; 0.4 to 1.4 by its copper"
    )
    body_to_air: float = _number(
        40.0, "K/W", 1e-3, 1e6, "Thermal resistance from body to air; 33 to 49 by its surface"
    )
    body_capacity: float = _number(
        7.8, "J/K", 1e-6, 1e6, "Heat capacity of the actuator's body; 6 to 10 by its mass"
    )

    def _check(self) -> None:
        _both_or_neither("coil", self, "eddy_inductance", "eddy_resistance")


RAMS = ("ram",)
"""Actuators in which a free ram is the coil's reaction body; in all others it is the ground."""


class Mechanics(Table):
    """Surface, ram and part."""

    actuator: Literal["ram", "direct"] = _choice(
        "ram", "Reaction body of the coil: a free ram, or a magnet on the ground (direct drive)"
    )
    ram_mass: float = _of_fmu("ram_mass")
    surface_mass: float = _of_fmu("surface_mass")
    part_mass: float = _of_fmu("part_mass")
    flexure_stiffness: float = _of_fmu("flexure_stiffness")
    flexure_damping: float = _of_fmu("flexure_damping")
    suspension: Literal["cubic", "knee", "repulsion"] = _choice(
        "cubic",
        "Law of the suspension: cubic, with k1, k2 and k3; knee, with k1, and harder below "
        "suspension_knee; repulsion, as of magnets below the ram",
    )
    suspension_k1: float = _of_fmu("suspension_k1")
    suspension_k2: float = _of_fmu("suspension_k2")
    suspension_k3: float = _of_fmu("suspension_k3")
    suspension_knee: float = _of_fmu("suspension_knee")
    suspension_hardening: float = _of_fmu("suspension_hardening")
    suspension_repulsion: float = _of_fmu("suspension_repulsion")
    suspension_distance: float = _of_fmu("suspension_distance")
    suspension_damping: float = _of_fmu("suspension_damping")
    travel: float = _of_fmu("travel")
    contact: Literal["compliant", "rigid"] = _choice(
        "compliant", "Law of the walls: Hunt-Crossley, or instantaneous Newton impacts"
    )
    restitution: float = _of_fmu("restitution")
    contact_stiffness: float = _of_fmu("contact_stiffness")
    contact_damping: float = _of_fmu("contact_damping")
    n_surfaces: int = _of_fmu("n_surfaces")
    gravity: float = _of_fmu("gravity")
    tolerance: float = _of_fmu("tolerance")
    initial_lift: float = _of_fmu("initial_lift")

    @property
    def free_ram(self) -> bool:
        """Whether the coil throws a ram."""
        return self.actuator in RAMS

    def _check(self) -> None:
        least = 1.1 * self.travel  # nearer, the force at the lower wall has no bound
        if self.suspension == "repulsion" and self.suspension_distance < least:
            raise fault(
                f"mechanics.suspension_distance = {self.suspension_distance:g} m must be at least "
                f"1.1 times mechanics.travel = {self.travel:g} m with "
                'mechanics.suspension = "repulsion"'
            )
        if not self.free_ram and self.contact == "rigid" and abs(self.initial_lift) > self.travel:
            raise fault(
                f"mechanics.initial_lift = {self.initial_lift:g} m must lie within "
                f"mechanics.travel = {self.travel:g} m with a rigid wall in direct drive"
            )


class Friction(Table):
    """Friction on the part."""

    law: Literal["coulomb"] = _choice(
        "coulomb", "Law of friction, exact in sticking; a part that may stick or slip on sticks"
    )
    mu_s: float = _of_fmu("mu_s")
    mu_k: float = _of_fmu("mu_k")
    normal_force: float = _of_fmu("normal_force")
    normal_force_file: str | None = _choice(
        None, "CSV with time [s] and normal_force [N], linear in between; replaces normal_force"
    )
    mu_plate: float = _of_fmu("mu_plate")

    @model_validator(mode="before")
    @classmethod
    def _one_force(cls, data: Any) -> Any:
        if isinstance(data, dict) and None not in map(data.get, NORMAL_FORCES):
            raise fault(said_twice(*(f"friction.{key}" for key in NORMAL_FORCES)))
        return data

    def _check(self) -> None:
        if self.mu_k > self.mu_s:
            raise fault(
                f"friction.mu_k = {self.mu_k:g} must be at most friction.mu_s = {self.mu_s:g}"
            )


class Coupling(Table):
    """How circuit and mechanics are joined; ngspice leads. With [[fmu]] the default is "auto"."""

    method: str = _declared("step-locked", "Coupling", METHODS)
    macro_step: float = _number(1e-4, "s", 1e-7, 1.0, "Macro step; ends at jumps of the command")
    order: int = _number(
        1, "1", 0, 2, "Order of extrapolation: held, with the true slope, parabola"
    )
    tolerance: float = _number(
        1e-3, "1", 1e-6, 0.5, "With auto: allowed error of the part's height, relative to its range"
    )


GIVEN_SURFACES = {
    "optimal": {"frequency", "acceleration_max", "optimum"},
    "quaid": {"frequency", "acceleration_max", "optimum"},
    "sine": {"frequency", "velocity_amplitude"},
    "file": {"file"},
}
"""Waveforms of ``[drive]`` that, with circuit none, are the surface's velocity, and their keys."""

MAX_ROWS = 20_000_000


class Run(Table):
    """What is simulated and written."""

    duration: float = _number(2.0, "s", 1e-6, 1e5, "Simulated time")
    settle: float = _number(
        *(0.8, "s", 0.0, 1e5),
        "Start of the averages; by default a multiple of 24, 12, 6 or 2 periods of the drive "
        "before the end, about half of the duration; of fewer than 4 periods the last one",
    )
    output_step: float = _number(5e-5, "s", 1e-9, 1e3, "Time between rows of the waveforms")
    shutter: float = _number(
        *(0.0, "1", 0.0, 1.0),
        "Exposure of the camera that reads the run, as a share of the time between its frames",
    )
    average: Literal["ends", "slope"] = _choice(
        "ends",
        "v_average: from end to end over the time; or the slope of the straight line through the "
        "part's heights in the frames of a camera, at settle + k/960 s, as a trial's record has it",
    )
    tolerance: float = _number(
        *(0.01, "1", 1e-6, 1.0),
        "Relative error of v_average that a simpler circuit may make: auto, ladder",
    )
    solver: Literal["fmu", "fast"] = _choice(
        "fmu", "fmu: finds each event; fast: fixed steps, many scenes side by side, in sweeps"
    )
    step: float = _number(4.3e-5, "s", 1e-7, 1e-3, "Step of the solver fast")

    def _check(self) -> None:
        for key in self.model_fields_set & {"settle", "output_step"}:
            if (value := getattr(self, key)) > self.duration - SHORTEST:
                longest = f"run.duration = {self.duration:.12g} s"
                raise fault(f"run.{key} = {value:.12g} s must be below {longest}")
        if self.duration / self.output_step > MAX_ROWS:
            raise fault(
                f"run.output_step = {self.output_step:g} s makes more than {MAX_ROWS} rows in "
                f"run.duration = {self.duration:g} s; it must be at least "
                f"{self.duration / MAX_ROWS:g} s"
            )


class Fmu(Table):
    """An FMU of the user's own."""

    name: str = Field(
        pattern=r"^[A-Za-z_]\w*$",
        max_length=32,
        description="Name, by which ports call it",
        json_schema_extra={"words": "a name of at most 32 letters, digits and _, but not drive"},
    )
    file: str = Field(
        description="Path of an FMU for co-simulation, FMI 2.0 or 3.0, relative to the scene file",
        json_schema_extra={"words": "the path of a file"},
    )
    parameters: dict[str, float | int | bool | str] = Field(
        default_factory=dict,
        description="Start values of its parameters, and of inputs that no port feeds",
        json_schema_extra={"words": "a table of values, { J = 1e-4 }"},
    )


_FEEDS = Literal["auto", "mean", "line", "end"]


class Port(Table):
    """What is joined to what."""

    probe: str | None = _choice(
        None, "Vector or expression of the netlist", words='a text such as "i(Vemf)"'
    )
    origin: str | None = Field(
        None,
        alias="from",
        description="Output of an FMU, name.output, or drive, the command of [drive]",
        json_schema_extra={"words": 'a text such as "rotor.omega", or "drive"'},
    )
    source: str | None = _choice(
        None, "Voltage or current source of the netlist that follows it", words="a source's name"
    )
    to: str | None = _choice(
        None, "Input of an FMU that follows it, name.input", words='a text such as "rotor.torque"'
    )
    scale: float = _number(1.0, "1", -1e12, 1e12, "Value there = scale * value here + offset")
    offset: float = _number(0.0, "1", -1e12, 1e12, "See scale")
    slope: str = _choice(
        "auto",
        "How a source goes on until the next communication point: held, with the difference of the "
        "last two, with the output named here as its slope; auto: with what the FMU tells of its "
        "slope, else the difference",
        words='"auto", "difference", "held", or an output of the same FMU',
    )
    feed: _FEEDS = _choice(
        "auto",
        "What an input is given for a step: mean, line (its start and slope) or end; auto: line "
        "where the FMU can, else mean",
        words='one of "auto", "mean", "line", "end"',
    )

    @field_validator("source", "probe")
    @classmethod
    def _read(cls, name: str | None) -> str | None:
        return name and name.replace(*SECTION_SIGN)

    @property
    def words(self) -> str:
        """Both ends, for messages."""
        return f"{self.probe or self.origin or 'nothing'} -> {self.source or self.to or 'nothing'}"

    def _check(self) -> None:
        if self.probe is not None and not self.probe.strip():
            raise fault("probe must be a vector or an expression of the netlist")
        if len(self.source or "") > LONGEST_NAME:
            raise fault(f"source must have at most {LONGEST_NAME} characters")
        if (self.probe is None) == (self.origin is None):
            raise fault(f"the port {self.words} must have either probe or from")
        if (self.source is None) == (self.to is None) or (self.probe and self.source):
            ends = "to, an input of an FMU" + " or source, one of the netlist" * (not self.probe)
            raise fault(f"the port {self.words} must have one end: {ends}")
        if self.slope != "auto" and self.origin in (None, "drive"):
            raise fault(
                f'the port {self.words}: slope = "{self.slope}" is for ports from an output of an '
                "FMU; leave it out"
            )


MACHINE = "machine"
"""The name by which ports call the built-in machine."""

MACHINE_ENDS = ("drive", *(f"{MACHINE}.{end}" for end in ("back_emf", "current", "out", "sense")))
"""Ends of ports to the built-in machine: its outputs to sources of the netlist (the first two),
then its inputs, the coils' current and the voltages of their two ends."""

PORT_LISTS: dict[str, type[Table]] = {"fmu": Fmu, "port": Port}
"""Lists of tables, for scenes with a machine of their own."""

TABLES: dict[str, type[Table]] = {
    "drive": Drive,
    "circuit": Circuit,
    "coil": Coil,
    "mechanics": Mechanics,
    "friction": Friction,
    "coupling": Coupling,
    "run": Run,
}
