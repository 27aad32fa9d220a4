"""The whole machine as an .ssp for other masters: circuit, mechanics and their connections.

The drive is a PWL source within the netlist, so that the machine needs no other input.
"""

import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import replace
from math import nextafter
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from cosim.circuit.joined import Deck
from cosim.circuit.netlist import prepare
from cosim.drive.command import command
from cosim.drive.pieces import LEVEL, SINE, Piece
from cosim.errors import BadInput
from cosim.files.atomic import whole
from cosim.fmus.netlist import write
from cosim.mechanics.package import unpacked, zipped
from cosim.mechanics.stickslip import parameters
from cosim.scene import Scene
from cosim.scene.firmware import GAIN
from cosim.scene.rungs import RUNGS

_FALL = 1e-9
"""s; duration of a jump of the drive, which must be above 0 in a PWL source."""

_PARTS = 400
"""Straight lines per period of a sine."""

_MOST = 200_000
"""Most points of a source; ngspice searches them at each step."""

_CURRENT = "cosim_current"
_SHOWN = {"z_surface": "m", "z_part": "m", "v_part": "m/s", "friction_force": "N"}
"""Further outputs of the mechanics, with their units."""


def ssp(scene: Scene, target: Path, fmi: int = 2) -> None:
    """Write the .ssp of a scene's machine. Raises BadInput where it has no circuit in ngspice, or
    inputs that an .ssp cannot hold."""
    able = [name for name, rung in RUNGS.items() if rung.ngspice and not rung.automatic]
    if scene.has_ports or scene.circuit.model not in able:
        raise BadInput(
            f"{scene.origin}: an .ssp is of the built-in machine with a circuit in ngspice: "
            f"circuit.model must be one of {', '.join(able)}, without an [[fmu]]."
        )
    if scene.renamed or scene.coupling.method == "companion":
        raise BadInput(
            f"{scene.origin}: an .ssp has a netlist with sources Vcommand and Vemf, without "
            '[[port]], and another coupling.method than "companion".'
        )
    if scene.friction.normal_force_file or scene.drive.phase_deg is not None:
        raise BadInput(f"{scene.origin}: an .ssp has one surface and a constant normal_force.")
    with tempfile.TemporaryDirectory(prefix="ssp-") as name:
        folder = Path(name)
        write(_deck(scene), ["Vemf"], folder / "circuit.fmu", scene.circuit.max_step, fmi)
        zipped(unpacked(fmi), folder / "mechanics.fmu")
        with whole(target) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("SystemStructure.ssd", _structure(scene))
            for fmu in ("circuit.fmu", "mechanics.fmu"):
                archive.write(folder / fmu, f"resources/{fmu}")


def _deck(scene: Scene) -> Deck:
    """The scene's circuit with its command inside, and the current of one coil."""
    made = prepare(scene)
    columns = {"vcommand": "v1", "vdac": "dac", "voffset": "pin"}
    lines = []
    for line in made.text.splitlines():
        name, *rest = line.split(" ", 3)
        column = columns.get(name.lower())
        if column and rest[-1] == "external":
            points = " ".join(f"{t:.12g} {v:.12g}" for t, v in _points(scene, column))
            line = f"{name} {rest[0]} {rest[1]} PWL({points})"
        lines.append(line)
    lines.insert(-1, f"B{_CURRENT} {_CURRENT} 0 V=i(vemf)/{scene.coil.count}")
    return replace(made, text="\n".join(lines), vectors={"current": f"v({_CURRENT})"})


def _points(scene: Scene, column: str) -> list[tuple[float, float]]:
    """Times and values of a source: before time 0 the command is 0, and both pins are at rest."""
    drive, end = command(scene), scene.run.duration
    found = [(0.0, 0.0 if column == "v1" else drive.v_offset)]
    for piece in drive.pieces(0.0, nextafter(end, 0.0), _MOST):  # none that begins at the end
        until = min(piece.until, end)
        values = _values(piece, until, column)
        t = np.linspace(piece.begin, until, len(values))
        same = abs(values[0] - found[-1][1]) <= 1e-12
        if not same:
            t[0] += _FALL
        found += zip(t[same:].tolist(), values[same:], strict=True)  # without a repeated point
        if len(found) > _MOST:
            raise BadInput(
                f"{scene.origin}: its drive has more than {_MOST} corners; a shorter "
                "run.duration or drive.quantised = false helps."
            )
    return found


def _values(piece: Piece, until: float, column: str) -> list[float]:
    """A source's values at equal distances in a piece of the drive."""
    if column == "pin":
        return [piece.pin] * 2
    if column == "dac" and piece.kind == LEVEL:
        return [piece.dac] * 2
    parts = 1
    if piece.kind == SINE:
        parts = max(1, round((until - piece.begin) * abs(piece.rate) * _PARTS))
    times = np.linspace(piece.begin, until, parts + 1)
    values = [*map(piece.value, times[:-1].tolist()), piece.before(until)]
    # Pieces of a smooth command lack the DAC's voltage; it follows from the pin's and V1.
    return values if column == "v1" else [piece.pin - value / GAIN for value in values]


def _structure(scene: Scene) -> str:
    reals, integers = parameters(scene)
    values = {name: f'Real value="{value!r}"' for name, value in reals.items()}
    values |= {name: f'Integer value="{value}"' for name, value in integers.items()}
    joined = (
        ("circuit.current", "mechanics.current"),
        ("mechanics.back_emf", "circuit.Vemf"),
        ("mechanics.back_emf_slope", "circuit.Vemf_slope"),
    )
    links = "\n".join(
        f'      <ssd:Connection startElement="{a}" startConnector="{b}" '
        f'endElement="{c}" endConnector="{d}"/>'
        for a, b, c, d in ((*out.split("."), *into.split(".")) for out, into in joined)
    )
    circuit = {"current": ("output", "A"), "Vemf": ("input", "V"), "Vemf_slope": ("input", "V/s")}
    mechanics = {"current": ("input", "A"), "back_emf": ("output", "V")}
    mechanics |= {"back_emf_slope": ("output", "V/s")}
    mechanics |= {name: ("output", unit) for name, unit in _SHOWN.items()}
    known = sorted({unit for _, unit in (circuit | mechanics).values()})
    units = "\n".join(f'    <ssc:Unit name="{each}"><ssc:BaseUnit/></ssc:Unit>' for each in known)
    step = scene.coupling.macro_step
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription version="1.0" name={quoteattr(scene.name)}
    xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
    xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
    xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"
    xmlns:osp="http://opensimulationplatform.com/SSP/OSPAnnotations">
  <ssd:System name="machine" description={quoteattr(scene.description)}>
    <ssd:Elements>
{_component("circuit", circuit, {})}
{_component("mechanics", mechanics, values)}
    </ssd:Elements>
    <ssd:Connections>
{links}
    </ssd:Connections>
  </ssd:System>
  <ssd:Units>
{units}
  </ssd:Units>
  <ssd:DefaultExperiment startTime="0" stopTime="{scene.run.duration!r}">
    <ssd:Annotations>
      <ssc:Annotation type="com.opensimulationplatform">
        <osp:Algorithm><osp:FixedStepAlgorithm baseStepSize="{step!r}"/></osp:Algorithm>
      </ssc:Annotation>
    </ssd:Annotations>
  </ssd:DefaultExperiment>
</ssd:SystemStructureDescription>
"""


def _component(
    name: str, connectors: Mapping[str, tuple[str, str]], values: Mapping[str, str]
) -> str:
    ports = "\n".join(
        f'          <ssd:Connector name="{port}" kind="{kind}"><ssc:Real unit="{unit}"/>'
        "</ssd:Connector>"
        for port, (kind, unit) in connectors.items()
    )
    given = "\n".join(
        f'              <ssv:Parameter name="{key}"><ssv:{value}/></ssv:Parameter>'
        for key, value in values.items()
    )
    binding = f"""
        <ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>
          <ssv:ParameterSet version="1.0" name="scene"><ssv:Parameters>
{given}
          </ssv:Parameters></ssv:ParameterSet>
        </ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>"""
    return f"""      <ssd:Component name="{name}" source="resources/{name}.fmu"
          type="application/x-fmu-sharedlibrary">
        <ssd:Connectors>
{ports}
        </ssd:Connectors>{binding if values else ""}
      </ssd:Component>"""
