"""A whole scene, and its text."""

import json
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import ceil, inf
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, model_validator

from cosim.errors import BadInput
from cosim.scene import firmware
from cosim.scene.describe import KEYS, Key
from cosim.scene.rungs import OF_PORTS, RUNGS, Rung
from cosim.scene.tables import (
    COMMANDS,
    FRAME_RATE,
    GIVEN_SURFACES,
    KNOBS,
    MACHINE,
    MACHINE_ENDS,
    PATHS,
    PORT_LISTS,
    RAMS,
    TABLES,
    Circuit,
    Coil,
    Coupling,
    Drive,
    Fmu,
    Friction,
    Mechanics,
    Port,
    Run,
    fault,
)
from cosim.stepper.stepper import VARIABLES

FITTED = {"settle", "output_step"}
"""Keys of [run] whose defaults depend on the drive and the duration."""

CAREFUL = {"max_step": 2e-5, "reltol": 1e-5}
"""Defaults for a user's netlist; s, 1."""

FASTEST = 1e-6
"""Least time constant, s, that the FMU's explicit integration can follow throughout a run: of a
coil, of a damper with its mass, and of a spring with its mass (1/ω)."""

FASTEST_NEAR, FASTEST_FAR, FAR = 1e-13, 1e-8, 2.0
"""Least time constants, s, of a coil in ngspice; faster coils take above a minute for 0.1 s. FAR
is for a drive that asks for FAR times the output's limit, which then acts for a third of the time
and more; NEAR for others, where rounding in a step looks like a motion towards the limits."""

_FAST = {*VARIABLES.values(), "n_surfaces", "coil_count", "initial_lift"} | {
    *("restitution", "tolerance"),  # of rigid walls, and of the FMU's own steps
}
"""Variables of the FMU that the fast solver takes, or that have no meaning for it."""

_FAST_NEEDS: list[tuple[str, Sequence[object], str]] = [
    ("circuit.model", ("limited", "ideal"), '"limited" or "ideal"'),
    ("drive.waveform", COMMANDS, "one that drives a coil"),
    ("drive.quantised", (False,), "false"),
    ("drive.phase_deg", (None,), "absent"),
    ("mechanics.actuator", ("ram",), '"ram"'),
    ("run.average", ("ends",), '"ends"'),
    ("mechanics.contact", ("compliant",), '"compliant"'),
    ("friction.normal_force_file", (None,), "absent"),
    *(
        (key.full, (key.default,), "absent" if key.default is None else f"{key.default:g}")
        for key in KEYS.values()
        if key.variable and key.variable not in _FAST
    ),
]
"""Conditions of the fast solver: keys, their allowed values, and these in words."""


def averaged(count: int) -> int:
    """The number of periods to average over where about ``count`` are wanted: a multiple of 24, 12,
    6 or 2, so that motion which repeats only after 2, 3, 4, 6 or 8 periods is averaged over whole
    repetitions, as far as ``count`` allows. A broken repetition biases the mean."""
    unit = next((each for each in (24, 12, 6, 2) if count >= 0.75 * each), 1)
    return (2 * count + unit) // (2 * unit) * unit


def periods_for(length: float, *times: float) -> list[int]:
    """How many periods of ``length`` (s) last at least each of ``times`` (s); one at least."""
    return [max(1, ceil(time / length - 1e-9)) for time in times]


@dataclass(frozen=True)
class Origin:
    """Where a scene is from; equal scenes may be from different files."""

    words: str = field(default="", compare=False)
    given: Mapping[str, str] = field(default_factory=dict[str, str], compare=False)
    """Keys that were given on top of the file, and by what: ``--set``."""


class Scene(BaseModel):
    """Everything that a run needs to know, checked; frozen and comparable."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    name: str = Field("scene", pattern=r"^\w[\w .+-]*$", max_length=64)
    description: str = Field("", pattern=r"^[^\x00-\x1f\x7f]*$", max_length=200)
    drive: Drive = Drive()
    circuit: Circuit = Circuit()
    coil: Coil = Coil()
    mechanics: Mechanics = Mechanics()
    friction: Friction = Friction()
    coupling: Coupling = Coupling()
    run: Run = Run()
    fmu: list[Fmu] = Field(default_factory=list, max_length=64)
    port: list[Port] = Field(default_factory=list, max_length=1024)
    _origin: Origin = PrivateAttr(default_factory=Origin)

    @model_validator(mode="before")
    @classmethod
    def _fill(cls, data: Any) -> Any:
        """Other defaults: CAREFUL for a user's netlist, the method "auto" with FMUs."""
        if not isinstance(data, dict):
            return data
        circuit, coupling = data.get("circuit", {}), data.get("coupling", {})
        model = circuit.get("model") if isinstance(circuit, dict) else None
        if isinstance(model, str) and model in RUNGS and RUNGS[model].own_netlist:
            data = data | {"circuit": CAREFUL | circuit}
        if data.get("fmu") and isinstance(coupling, dict):
            data = data | {"coupling": {"method": "auto"} | coupling}
        return data

    @model_validator(mode="after")
    def _check(self) -> "Scene":
        self._fit_times()
        self._check_ports()
        self._check_speed()
        self._check_speed_of_circuit()
        self._check_speed_of_mechanics()
        self._check_phase()
        self._check_solver()
        self._check_reach()
        return self

    def _fit_times(self) -> None:
        """Set the defaults of ``settle`` and ``output_step``. A mean over a broken period is off by
        per cents, so averages cover whole periods, as :func:`averaged` counts them."""
        given, duration = self.run.model_fields_set, self.run.duration
        fitted = {"output_step": min(self.run.output_step, duration / 2)}
        if "settle" not in given and self.drive.waveform == "file":
            fitted["settle"] = 0.0  # a record has no period
        elif "settle" not in given:
            length = self.period
            half = int(duration / 2 / length * (1 + 1e-9))
            count = averaged(half) or int(duration >= length)
            settle = round(max(0.0, duration - count * length), 14)  # as one writes it
            fitted["settle"] = settle if count else duration / 2
        # Not marked as given (model_fields_set): another drive or duration has another default.
        known = {name: getattr(self.run, name) for name in given}
        run = Run.model_construct(given, **fitted | known)
        object.__setattr__(self, "run", run)
        if run.average == "slope" and run.duration - run.settle < 0.99 / FRAME_RATE:
            raise fault(
                f"run.settle = {run.settle:g} s leaves less than two frames, 1/{FRAME_RATE:g} s "
                f'apart, of run.duration = {run.duration:g} s: run.average = "slope" needs them'
            )

    def _check_ports(self) -> None:
        """Check ports as far as possible without reading the FMUs and the netlist."""
        method, model = self.coupling.method, self.circuit.model
        if not self.has_ports and method in OF_PORTS[2:]:
            raise fault(f'coupling.method = "{method}" is for scenes with [[port]]')
        if not self.fmu and not self.port:
            return
        if not self.rung.own_netlist:
            raise fault(f'[[fmu]] and [[port]] need circuit.model = "file", not "{model}"')
        if self.run.solver != "fmu":
            raise fault('run.solver must be "fmu" with [[port]]')
        if not self.has_ports:
            self._check_machine()
            return
        if method not in OF_PORTS:
            known = ", ".join(f'"{name}"' for name in OF_PORTS)
            raise fault(f'coupling.method = "{method}" must be one of {known} with [[fmu]]')
        force, ends = f"{MACHINE}.normal_force", [str(port.to or port.origin) for port in self.port]
        joined = any(end.startswith(f"{MACHINE}.") for end in ends)
        if self.friction.normal_force_file and joined and force not in ends:
            raise fault(
                "as one of the FMUs the machine has a constant friction.normal_force, not that of "
                f'friction.normal_force_file: leave it out, or feed "{force}" by a [[port]]'
            )
        names = [MACHINE, *(fmu.name for fmu in self.fmu)]
        for name in names:
            if names.count(name) > 1 or name == "drive":
                raise fault(f'[[fmu]] name = "{name}" must be another: it is taken')
        for port in self.port:
            for key, end in (("from", port.origin), ("to", port.to)):
                if end is None or (key, end) == ("from", "drive"):
                    continue
                name, dot, _ = end.partition(".")
                if name not in names or not dot:
                    lacks = f"; there is no [[fmu]] {name}" if dot else ""
                    known = " or ".join(f"{name}.…" for name in names)
                    raise fault(f'[[port]] {key} = "{end}" must be a variable {known}{lacks}')
        for key in ("source", "to"):
            given = [str(getattr(port, key)).lower() for port in self.port if getattr(port, key)]
            for end in given:
                if given.count(end) > 1:
                    raise fault(f'[[port]] {key} = "{end}" is given twice')

    def _check_machine(self) -> None:
        """Check ports without FMUs, which only name the machine's ends in the netlist."""
        for port in self.port:
            end = port.to or port.origin
            if port.scale != 1.0 or port.offset != 0.0:
                raise fault(f"the port {port.words}: without [[fmu]] scale must be 1 and offset 0")
            in_netlist = port.source if end in MACHINE_ENDS[:2] else port.probe
            if end not in MACHINE_ENDS or in_netlist is None:
                raise fault(
                    f'the port {port.words} must be one of from = "drive" or "machine.back_emf" to '
                    'a source and probe to "machine.current", "machine.out" or "machine.sense"'
                )
        names = self.renamed
        if len(names) < len(self.port):
            raise fault("[[port]]: an end of the machine is given twice")
        for end in MACHINE_ENDS[:3]:
            if end not in names:
                way = "from" if end in MACHINE_ENDS[:2] else "to"
                raise fault(f'there is no [[port]] with {way} = "{end}", which the machine needs')
        emf, current = names["machine.back_emf"], names["machine.current"]
        if "".join(current.lower().split()) != f"i({emf.lower()})":
            raise fault(
                f'the port of machine.current must have probe = "i({emf})", the current of the '
                "source that is the back-EMF"
            )

    def _check_speed(self) -> None:
        """One explicit method solves coil and mechanics in the FMU: the coil must not be stiff."""
        if not self.rung.source_in_fmu:
            return
        coil = self.coil
        eddy = coil.eddy_resistance or 0.0
        around = coil.resistance + self.sense + eddy
        for key, resistance in (("inductance", around), ("eddy_inductance", eddy)):
            inductance = getattr(coil, key)
            if inductance is not None and inductance < FASTEST * resistance:
                raise fault(
                    f"coil.{key} = {inductance:g} H must be at least {FASTEST * resistance:.3g} H "
                    f'with circuit.model = "{self.rung.name}" and {resistance:g} Ohm around it, or '
                    "the current changes too fast to be solved with the mechanics",
                    *("coil.resistance", "coil.eddy_resistance", "coil.count"),
                    "circuit.sense_resistance",
                )

    def _check_speed_of_circuit(self) -> None:
        """At the output's limits each step of ngspice is as short as the coil's time constant."""
        drive, circuit, coil = self.drive, self.circuit, self.coil
        peak, sense = abs(drive.offset) + drive.amplitude / 2.0, circuit.sense_resistance
        around = coil.resistance + self.sense
        needed = min(peak / sense, circuit.current_limit) * around / coil.count
        room = circuit.supply - min(circuit.swing_loss_high, circuit.swing_loss_low)
        least = (FASTEST_FAR if needed > FAR * room else FASTEST_NEAR) * around
        driven = peak and self.rung.ngspice and drive.start_time < self.run.duration
        if driven and not self.rung.own_netlist and coil.inductance < least:
            raise fault(
                f"coil.inductance = {coil.inductance:g} H must be at least {least:.3g} H with "
                f"coil.resistance = {coil.resistance:g} Ohm and circuit.sense_resistance = "
                f"{sense:g} Ohm, where {peak:g} V of the drive ask {needed:.3g} V of the output, "
                "or the circuit is too fast to be solved",
                *("coil.count", "circuit.supply", "drive.amplitude", "drive.offset"),
            )

    def _check_speed_of_mechanics(self) -> None:
        """Springs and dampers that always act must not be stiff either; for walls see ``Pace``."""
        if self.surface_is_given:
            return
        rig = self.mechanics
        surface, masses = rig.surface_mass, f"mechanics.surface_mass = {rig.surface_mass:g} kg"
        both, of_both = surface, masses
        if rig.free_ram:
            both = 1.0 / (1.0 / surface + 1.0 / rig.ram_mass)
            of_both = f"mechanics.ram_mass = {rig.ram_mass:g} kg and {masses}"
        for key, most, named in (
            ("flexure_damping", surface / FASTEST, masses),
            ("flexure_stiffness", surface / FASTEST**2, masses),
            ("suspension_damping", both / FASTEST, of_both),
            ("suspension_k1", both / FASTEST**2, of_both),
        ):
            value = getattr(rig, key)
            if value > most:
                unit = KEYS[f"mechanics.{key}"].unit
                raise fault(
                    f"mechanics.{key} = {value:g} {unit} must be at most {most:.3g} {unit} with "
                    f"{named}, or the bodies move too fast to be solved"
                )

    def _check_phase(self) -> None:
        """Only the FMU solves two surfaces that move independently, and without a plate."""
        if self.drive.phase_deg is None:
            return
        able = sorted(name for name, rung in RUNGS.items() if rung.driven and not rung.ngspice)
        self._need(
            "drive.phase_deg lets two surfaces move by themselves",
            ("circuit.model", able, " or ".join(f'"{name}"' for name in able)),
            ("coil.count", (1,), "1: each surface has a source of its own"),
            ("mechanics.n_surfaces", (2,), "2"),
            ("mechanics.actuator", RAMS, " or ".join(map(toml_value, RAMS))),
            ("friction.mu_plate", (0.0,), "0"),
        )

    def _need(self, why: str, *needed: tuple[str, Sequence[object], str]) -> None:
        """Raise where a value is not allowed; ``needed``: keys, allowed values, these in words."""
        for full, allowed, words in needed:
            table, _, key = full.partition(".")
            value = getattr(getattr(self, table), key)
            if value not in allowed:
                shown = f"{value:g}" if type(value) in (int, float) else toml_value(value)
                raise fault(f"{why}; with it {full} = {shown} must be {words}")

    def _check_solver(self) -> None:
        """The fast solver models the machine's common case only: see _FAST_NEEDS."""
        if self.run.solver != "fast":
            return
        why = 'run.solver = "fast" has fixed steps for one free ram'
        self._need(why, *_FAST_NEEDS)
        if self.mechanics.initial_lift and not self.friction.mu_plate * self.friction.normal_force:
            self._need(why, ("mechanics.initial_lift", (0.0,), "0 without friction.mu_plate"))
        most = 0.1 / self.run.step
        if self.drive.frequency > most:
            raise fault(
                f"drive.frequency = {self.drive.frequency:g} Hz must be at most {most:g} Hz with "
                f"run.step = {self.run.step:g} s of the fast solver"
            )

    def _check_reach(self) -> None:
        drive = self.drive
        if drive.pwm_ripple:
            why = "drive.pwm_ripple is of the offset pin, which only the whole schematic has"
            self._need(why, ("circuit.model", ("full",), '"full"'))
        if drive.waveform not in COMMANDS:
            why = f'drive.waveform = "{drive.waveform}" gives the surface its velocity'
            self._need(why, ("circuit.model", ("none",), '"none"'))
        if self.friction.normal_force_file and self.surface_is_given:
            raise fault(
                f'drive.waveform = "{drive.waveform}" with circuit.model = "none" moves the part '
                "at a constant friction.normal_force, not at that of friction.normal_force_file"
            )
        if not self.rung.driven or not (self.rung.firmware or drive.quantised):
            return
        why = "with drive.quantised = true"
        if self.rung.firmware:
            why = f'with circuit.model = "{self.rung.name}"'
        others = ("drive.pot_max", "circuit.model", "drive.quantised")
        reach = firmware.GAIN * firmware.V_REFERENCE
        if drive.amplitude > reach:
            raise fault(
                f"drive.amplitude = {drive.amplitude:g} V must be a number from 0 to "
                f"{reach:.4g} V {why}, whose DAC ends at {firmware.V_REFERENCE} V",
                *others,
            )
        pin = firmware.offset_pin(drive.offset, drive.amplitude)
        # Volts typed to six digits may put a knob that is at its end a microvolt outside.
        if not -1e-6 <= pin <= firmware.V_REFERENCE + 1e-6:
            half = drive.amplitude / 2
            raise fault(
                f"drive.offset = {drive.offset:g} V must be a number from {-half:.4g} to "
                f"{reach - half:.4g} V {why} and drive.amplitude = {drive.amplitude:g} V, "
                f"for its offset pin gives 0 to {firmware.V_REFERENCE} V",
                *others,
            )

    @property
    def origin(self) -> str:
        """The file that the scene is from, or its name, as messages begin with it."""
        return self._origin.words or f"scene {self.name}"

    @property
    def given(self) -> Mapping[str, str]:
        """The keys that were given on top of the file, and by what: ``--set``."""
        return self._origin.given

    def of(self, origin: str, given: Mapping[str, str]) -> "Scene":
        """This scene, with another :attr:`origin` and :attr:`given`."""
        self._origin = Origin(origin, given)
        return self

    def bad(self, words: str) -> BadInput:
        """A fault in a sentence that begins with the option that gave the key it tells of, else
        with :attr:`origin`."""
        for key, option in self.given.items():
            name = re.escape(key)
            if key.startswith("fmu."):  # where FMUs are read, theirs are told without its name
                name += rf"|parameters {re.escape(key.split('.', 2)[2])}"
            if re.search(rf"\b({name})(?![\w.])", words):
                return BadInput(f"{option}: {words}")
        return BadInput(f"{self.origin}: {words}")

    @property
    def period(self) -> float:
        """The drive's period, s; infinite without a drive, and for a surface moved by a file. For
        the firmware's staircase it differs from 1 / ``drive.frequency``."""
        drive = self.drive
        if self.has_ports and not any(port.origin == "drive" for port in self.port):
            return inf
        if not self.rung.driven and (not self.surface_is_given or drive.waveform == "file"):
            return inf
        if self.rung.driven and drive.quantised:
            return firmware.period(drive.frequency, drive.loop_time)
        return 1.0 / drive.frequency

    @property
    def files(self) -> dict[str, str]:
        """The paths of the files that the scene names, by key."""
        given = {f"{table}.{key}": getattr(getattr(self, table), key) for table, key in PATHS}
        given |= {f"fmu.{fmu.name}.file": fmu.file for fmu in self.fmu}
        return {key: path for key, path in given.items() if path is not None}

    @property
    def has_ports(self) -> bool:
        """Whether ports join FMUs to the circuit, or the built-in machine as if it were an FMU, by
        a method for scenes with ports only."""
        alike = self.coupling.method in OF_PORTS[2:]
        return bool(self.fmu) or (bool(self.port) and (alike or not self.renamed))

    @property
    def renamed(self) -> dict[str, str]:
        """If ports join a netlist to the built-in machine alone: the netlist's own names, by the
        machine's ends (MACHINE_ENDS); else empty."""
        names = {str(p.to or p.origin): str(p.source or p.probe) for p in self.port}
        of_machine = any(end.startswith(f"{MACHINE}.") for end in names)
        return names if of_machine and not self.fmu else {}

    @property
    def rung(self) -> Rung:
        """The declaration of the scene's ``circuit.model``."""
        return RUNGS[self.circuit.model]

    @property
    def sense(self) -> float:
        """The sense resistor as the current of one coil sees it, Ohm: it carries that of all."""
        return self.coil.count * self.circuit.sense_resistance

    @property
    def surface_is_given(self) -> bool:
        """Whether the drive prescribes the surface's velocity, and only the part moves freely."""
        return not self.rung.driven and self.drive.waveform in GIVEN_SURFACES

    def as_dict(self) -> dict[str, Any]:
        """The scene as plain tables that load to an equal scene, without absent or doubled keys."""
        data: dict[str, Any] = {"name": self.name, "description": self.description}
        data |= {table: self.table(table) for table in TABLES}
        return data | {name: self.table(name) for name in PORT_LISTS if getattr(self, name)}

    def as_given(self) -> dict[str, Any]:
        """:meth:`as_dict` without those of FITTED that have their defaults."""
        absent = FITTED - self.run.model_fields_set
        run = {key: value for key, value in self.table("run").items() if key not in absent}
        return self.as_dict() | {"run": run}

    def having(self, **tables: dict[str, Any]) -> "Scene":
        """The scene with other values for keys of some tables, which are not checked."""
        changed = {name: getattr(self, name).model_copy(update=own) for name, own in tables.items()}
        return self.model_copy(update=changed)

    def value(self, key: str) -> Any:
        """The value of a ``table.key`` in :meth:`as_dict`; None where it has none."""
        table, _, name = key.partition(".")
        return self.table(table).get(name)

    def table(self, name: str) -> Any:
        """One of the tables of :meth:`as_dict`."""
        if name in PORT_LISTS:
            own = getattr(self, name)
            return [each.model_dump(exclude_none=True, by_alias=True) for each in own]
        values = getattr(self, name).model_dump(exclude_none=True)
        for knob, key in KNOBS.items():
            if name == "drive" and knob in values:
                del values[key]
        if values.get("normal_force_file"):
            del values["normal_force"]
        return values


def toml_value(value: bool | float | int | str | list[Any] | dict[str, Any]) -> str:
    """A value as TOML spells it."""
    if isinstance(value, dict):
        pairs = (f"{toml_value(key)} = {toml_value(each)}" for key, each in value.items())
        return f"{{ {', '.join(pairs)} }}"
    if isinstance(value, float):  # perhaps inf or nan, for messages
        return repr(value)
    # JSON's lists, words and whole numbers are TOML's, but for DEL.
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def schema() -> dict[str, Any]:
    """The scene file's keys as a JSON schema (draft 2020-12), by which editors complete and check
    TOML; units stand in the descriptions. A scene is checked further as it is loaded."""
    found = Scene.model_json_schema()
    base = "Built-in scene whose values hold where none stand"
    found["properties"]["base"] = {"type": "string", "description": base}
    for table in found["$defs"].values():
        for key in table["properties"].values():
            unit = key.pop("unit", "")
            if unit not in ("", "1"):
                key["description"] += f" [{unit}]"
    title = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "Scene of cosim"}
    return found | title


def to_toml(scene: Scene, base: str = "", folder: str | os.PathLike[str] | None = None) -> str:
    """The resolved scene as TOML: every key with its unit and meaning; loads to an equal scene.

    A key without a value, set by a knob, or with a default that drive and duration give, is
    commented out. With the name of a built-in scene as ``base`` all keys are: the file is then a
    template. Paths are those from a ``folder`` where it is given, in which the file is to lie, and
    the files are near (:func:`_near`).
    """
    data = scene.as_given()
    first = {"base": base} if base else {"name": scene.name}
    first["description"] = scene.description
    lines = [f"{key} = {toml_value(value)}" for key, value in first.items()]
    for table in TABLES:
        lines += ["", f"[{table}]"]
        for key in (key for key in KEYS.values() if key.table == table):
            value = getattr(getattr(scene, table), key.name)
            mark = "" if key.name in data[table] and not base else "# "
            if value is not None and (table, key.name) in PATHS:
                value = _near(value, folder)
            shown = "" if value is None else toml_value(value)
            unit = "" if key.unit in ("", "1") else f"{key.unit}; "
            lines.append(f"{mark}{key.name} = {shown}  # {unit}{key.text}{_turned(scene, key)}")
    for table in PORT_LISTS:
        for each in scene.table(table):
            if "file" in each:
                each = each | {"file": _near(each["file"], folder)}
            lines += ["", f"[[{table}]]"]
            lines += [f"{key} = {toml_value(value)}" for key, value in each.items()]
    return "\n".join(lines) + "\n"


def _near(path: str, folder: str | os.PathLike[str] | None) -> str:
    """The path from a folder, if no more than two above it hold the file: what lies beside
    ``results/NAME`` is moved to another machine together with it. Else, and where the folder is
    reached by a link, from which ``..`` leads elsewhere, the path as it is."""
    if folder is None or os.path.realpath(folder) != os.path.abspath(folder):
        return path
    try:
        found = Path(os.path.relpath(path, folder))
    except ValueError:  # another drive
        return path
    return path if found.parts[:3] == ("..",) * 3 else found.as_posix()


def differing(scene: Scene) -> list[str]:
    """The lines of :func:`to_toml` whose values are not the defaults."""
    usual = {*to_toml(Scene(name=scene.name, description=scene.description)).splitlines()}
    found: list[str] = []
    for line in to_toml(scene).splitlines()[2:]:
        if line.startswith("["):
            while found and found[-1].startswith("[") and not found[-1].startswith("[["):
                found.pop()  # an empty table
            found.append(line)
        elif line and line not in usual and not line.startswith("#"):
            found.append(line)
    return found


def _turned(scene: Scene, key: Key) -> str:
    """What a knob stands for, as the end of its comment."""
    if key.name not in KNOBS or getattr(scene.drive, key.name) is None:
        return ""
    name = KNOBS[key.name]
    return f"; {name} {getattr(scene.drive, name):.4g} {KEYS[f'drive.{name}'].unit}"
