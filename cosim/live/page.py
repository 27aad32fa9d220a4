"""The page of `cosim live`: one HTML file that needs nothing else, and asks nobody."""

import base64
import hashlib
import json
from pathlib import Path
from typing import Any

from cosim.circuit.heat import DRIVE_RANGE_HEAT, rise
from cosim.errors import BadInput
from cosim.live import rigs
from cosim.scene import Scene, load, to_link

_WEB = Path(__file__).with_name("web")
_CORE = ("machine.js", "hosts.js")
_SCRIPTS = ("machine.js", "settings.js", "picture.js", "curves.js", "page.js")


def fragment(scene: str, overrides: tuple[str, ...] | list[str] = ()) -> str:
    """The link of a scene as the page takes it. Raises BadInput for one that it cannot run."""
    checked = load(scene, overrides)
    if not rigs.fits(checked):
        raise BadInput(
            f"scene {checked.name}: the page runs a free ram that a coil drives, without files, "
            f"staircase or second surface; for example {', '.join(list(rigs.scenes())[:3])}."
        )
    return to_link(checked)


def html(link: str, served: bool) -> str:
    """The page, which begins with the setting of ``link`` unless its address has another.

    ``served`` lets it ask its own server for a run with ngspice.
    """
    known = rigs.data()
    for name, scene in rigs.scenes().items():
        known["scenes"][name]["rise"] = rise(scene.coil)
    known |= {"start": link, "heat": DRIVE_RANGE_HEAT}
    binary = base64.b64encode((_WEB / "machine.wasm").read_bytes()).decode()
    given = {"DATA": known, "BINARY": binary, "CORE": script(_CORE), "SERVED": served}
    lines = [f"const {name} = {_literal(value)};" for name, value in given.items()]
    code = "\n".join([*lines, script(_SCRIPTS)])
    digest = base64.b64encode(hashlib.sha256(code.encode()).digest()).decode()
    asks = "'self'" if served else "'none'"
    policy = (
        f"default-src 'none'; script-src 'sha256-{digest}' 'wasm-unsafe-eval' data: blob:; "
        "worker-src blob:; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'; "
        f"connect-src {asks}"
    )
    page = (_WEB / "page.html").read_text(encoding="utf-8")
    return page.replace("@POLICY@", policy).replace("@SCRIPT@", code)


def script(names: tuple[str, ...]) -> str:
    """The scripts as one."""
    return "\n".join((_WEB / name).read_text(encoding="utf-8") for name in names)


def _literal(value: Any) -> str:
    """JSON that cannot end a script's element."""
    return json.dumps(value, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def answer(link: str) -> dict[str, Any]:
    """What ngspice has for a link of the page: mean velocity (m/s) and the waveforms of the last
    0.3 s. Raises CosimError."""
    import cosim

    scene: Scene = load(link, {"circuit.model": "amplifier"})
    period = scene.period
    last = max(0.3, 2.0 * period)
    settle = max(0.7, 2.0 * period)
    whole = round(max(1.0, last / period)) if period > last else round(last / period)
    times = {"run.settle": settle, "run.duration": settle + whole * period}
    if times["run.duration"] > 10.0:
        raise BadInput("The server runs frequencies of 0.5 Hz and more.")
    result = cosim.run(load(scene, times | {"run.output_step": 5e-5}))
    rows = result.waveforms.sel(time=slice(times["run.duration"] - last, None))
    return {
        "v_average": result.summary["v_average"],
        "frequency": scene.drive.frequency,
        "begin": float(rows.time[0]),
        "step": 5e-5,
        "waveforms": {name: [float(f"{x:.6g}") for x in rows[name].values] for name in _DRAWN},
    }


_DRAWN = (
    *("command", "current", "coil_voltage", "z_surface", "v_surface", "a_surface"),
    *("z_ram", "v_ram", "z_part", "v_part"),
)
