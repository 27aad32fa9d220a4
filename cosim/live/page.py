"""The page of `cosim live`: one HTML file that needs nothing else, and asks nobody."""

import base64
import hashlib
import json
from collections.abc import Iterable
from math import ceil
from pathlib import Path
from typing import Any

from cosim.circuit.heat import DRIVE_RANGE_HEAT
from cosim.errors import BadInput
from cosim.live import rigs
from cosim.scene import load, to_link

_WEB = Path(__file__).with_name("web")
_CORE = ("machine.js", "hosts.js")
_SCRIPTS = ("machine.js", "settings.js", "picture.js", "curves.js", "page.js")


def fragment(scene: str, overrides: Iterable[str] = ()) -> str:
    """The link of a scene as the page takes it. Raises BadInput for one that it cannot run."""
    checked = load(scene, overrides)
    if not rigs.fits(checked):
        known = ", ".join(rigs.scenes())
        raise BadInput(f"scene {checked.name}: the page runs {known}, and such as these.")
    return to_link(checked)


def html(link: str, served: bool) -> str:
    """The page, which begins with the setting of ``link`` unless its address has another.

    ``served`` lets it ask its own server for a run with ngspice.
    """
    known = rigs.data()
    known |= {"start": link, "heat": DRIVE_RANGE_HEAT}
    binary = base64.b64encode((_WEB / "machine.wasm").read_bytes()).decode()
    given = {"DATA": known, "BINARY": binary, "CORE": script(_CORE), "SERVED": served}
    lines = (f"const {name} = {_literal(value)};" for name, value in given.items())
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
    """What ngspice has for a link of the page: mean velocity (m/s) of a second, and the waveforms
    of its last 0.3 s or two periods. Raises CosimError."""
    import cosim

    scene = load(link, {"circuit.model": "amplifier"})
    frequency, settle = scene.drive.frequency, 0.7
    if frequency < 0.5:
        raise BadInput("The server runs frequencies of 0.5 Hz and more.")
    end = settle + ceil(frequency) / frequency
    times = {"run.settle": settle, "run.duration": end, "run.output_step": 5e-5}
    result = cosim.run(load(scene, times))
    rows = result.waveforms.sel(time=slice(end - min(end, max(0.3, 2.0 / frequency)), None))
    return {
        "v_average": result.summary["v_average"],
        "frequency": frequency,
        "begin": float(rows.time[0]),
        "step": times["run.output_step"],
        "waveforms": {str(name): rows[name].values.tolist() for name in rows.data_vars},
    }
