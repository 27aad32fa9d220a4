"""Self-contained HTML pages that load nothing from elsewhere; the page of `cosim live`."""

import base64
import hashlib
import json
from collections.abc import Iterable
from math import ceil, isfinite
from pathlib import Path
from typing import Any

import numpy as np

from cosim.circuit.heat import COPPER, DRIVE_RANGE_HEAT
from cosim.errors import BadInput, plain
from cosim.live import rigs
from cosim.scene import load, to_link
from cosim.scene.rungs import LADDER, RUNGS
from cosim.scene.tables import FRAME_RATE
from cosim.toolchain.threads import Progress
from cosim.trials.recording import GAP, Recording

_WEB = Path(__file__).with_name("web")
_CORE = ("machine.js", "hosts.js")
_SCRIPTS = ("machine.js", "settings.js", "plot.js", "picture.js", "curves.js", "page.js")

MOST_ROWS = 1_000_000
"""Rows of a record, resampled at its median step."""

CIRCUITS: dict[str, dict[str, Any]] = {
    model: {"circuit.model": model} for model in LADDER if RUNGS[model].ngspice
}
"""Circuits that the server runs with ngspice, by their names on the page: values of a scene's keys,
and under "port" the ports of a netlist that has any."""


def opened(scene: str, overrides: Iterable[str] = ()) -> tuple[str, dict[str, dict[str, Any]]]:
    """The link of a scene for the page, and the circuits with which the server runs it. A user's
    netlist becomes the circuit "own", while the page itself runs the scene without it. Raises
    BadInput for a scene that the page cannot run."""
    found, circuits = load(scene, list(overrides)), dict(CIRCUITS)
    if found.circuit.netlist and not found.has_ports:
        rest = found.table("circuit")
        own = {key: rest.pop(key, None) for key in ("netlist", "reltol", "max_step")}
        rest.pop("save", None)  # the page has the machine's own curves only
        own["netlist"] = str(Path(own["netlist"]).absolute())
        own |= {f"param.{key}": v for key, v in (rest.pop("param", None) or {}).items()}
        own = {"circuit.model": "file"} | {f"circuit.{key}": v for key, v in own.items()}
        circuits = {"own": own | ({"port": found.port} if found.port else {})} | circuits
        simple = type(found.circuit).model_validate(rest | {"model": "amplifier"})
        found = found.model_copy(update={"circuit": simple, "port": []})
    if not rigs.fits(found):
        known = ", ".join(rigs.scenes())
        raise BadInput(
            f"{found.origin}: the page runs {known}, and such as these: a free ram, its "
            "drive from time 0 on, and no [[port]], own file, DAC steps, PWM ripple or "
            "drive.phase_deg."
        )
    link, known = to_link(found), rigs.TURNED
    for key in (pair.partition("=")[0] for pair in link.split("&")[1:]):
        if key not in known and not key.startswith(("run.", "coupling.")):
            raise found.bad(f"the page cannot turn {plain(key)}.")
    return link, circuits


def html(link: str, models: Iterable[str] = (), record: Recording | None = None) -> str:
    """The page, which starts with the setting of ``link`` unless its address has another.

    It offers runs by its own server with the circuits ``models``. ``record``, measurements of a
    machine, is laid over its curves. Raises BadInput.
    """
    known = rigs.data() | {"start": link, "models": [*models]}
    known |= {"heat": DRIVE_RANGE_HEAT, "copper": COPPER, "frame_rate": FRAME_RATE}
    known["record"] = None if record is None else _record(record)
    binary = base64.b64encode((_WEB / "machine.wasm").read_bytes()).decode()
    given = {"DATA": known, "BINARY": binary, "CORE": script(_CORE)}
    return page("page.html", script_of(given, _SCRIPTS), "'self'" if known["models"] else "'none'")


def script_of(given: dict[str, Any], scripts: tuple[str, ...]) -> str:
    """A script: constants by name, as JSON that cannot end a script element, then ``scripts``."""
    code = ['"use strict";']
    for name, value in given.items():
        content = json.dumps(value, separators=(",", ":"), allow_nan=False)
        code.append(f"const {name} = {content};".replace("<", "\\u003c"))
    return "\n".join([*code, script(scripts)])


def page(name: str, code: str, asks: str) -> str:
    """The page ``name``, whose policy lets only its script ``code`` run, and ask only ``asks``."""
    digest = base64.b64encode(hashlib.sha256(code.encode()).digest()).decode()
    policy = (
        f"default-src 'none'; script-src 'sha256-{digest}' 'wasm-unsafe-eval' data: blob:; "
        "worker-src blob:; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; "
        f"form-action 'none'; connect-src {asks}"
    )
    parts = {"@POLICY@": policy, "@STYLE@": script(("style.css",)), "@SCRIPT@": code}
    text = script(("head.html", name))
    for mark, part in parts.items():
        text = text.replace(mark, part)
    return text


def script(names: tuple[str, ...]) -> str:
    return "\n".join((_WEB / name).read_text(encoding="utf-8") for name in names)


def _record(found: Recording) -> dict[str, Any]:
    """Measurements for the page, in even steps (s); None where there is no sample nearby."""
    step = float(np.median(np.diff(found.time)))
    even = np.arange(min(round(found.time[-1] / step) + 1, MOST_ROWS)) * step
    after = np.searchsorted(found.time, even).clip(1, len(found.time) - 1)
    nearest = after - (even - found.time[after - 1] < found.time[after] - even)
    known = np.abs(found.time[nearest] - even) <= GAP / 2.0 * step
    signals = {}
    for name, values in found.signals.items():
        there = np.where(known, values[nearest], np.nan).tolist()
        signals[name] = [value if isfinite(value) else None for value in there]
    return {"name": found.name, "step": step, "waveforms": signals}


def answer(link: str, circuit: dict[str, Any], progress: Progress) -> dict[str, Any]:
    """ngspice's result for a link of the page: the mean velocity (m/s) over a second, and waveforms
    of its last 0.3 s or two periods; ``begin`` is their start, s after the drive's phase was 0.
    ``progress`` is called with the simulated time, s, and may raise. Raises CosimError."""
    from cosim.simulation.simulate import simulate

    values = {key: x for key, x in circuit.items() if key != "port"}
    ported = {"port": circuit.get("port")}
    scene = load(load(link).model_copy(update=ported) if ported["port"] else link, values)
    frequency, settle = scene.drive.frequency, 0.7
    if frequency < 0.5:
        raise BadInput("The server runs frequencies of 0.5 Hz and more.")
    end = settle + ceil(frequency) / frequency
    times = {"run.settle": settle, "run.duration": end, "run.output_step": 5e-5}
    result = simulate(load(scene, times), progress)
    rows = result.waveforms.sel(time=slice(end - min(end, max(0.3, 2.0 / frequency)), None))
    return {
        "v_average": result.summary["v_average"],
        "frequency": frequency,
        "begin": float(rows.time[0]) - scene.drive.start_time + scene.drive.start_phase / frequency,
        "step": times["run.output_step"],
        "waveforms": {str(name): rows[name].values.tolist() for name in rows.data_vars},
    }
