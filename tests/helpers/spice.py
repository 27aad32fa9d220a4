"""Runs decks in plain ngspice, through its shared library in a process of its own.

ngspice keeps state, and an error in a netlist disables the library for good.
"""

import json
import logging
import multiprocessing
import os
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
from PySpice.Spice.NgSpice.Shared import NgSpiceShared

from tests.helpers.ngspice_alone import LIBRARY

CIRCUITS = Path(__file__).resolve().parents[2] / "circuits"

# A process that has imported all this, and never loads ngspice, is forked for each call: imports
# take longer than most runs.
FRESH = multiprocessing.get_context("forkserver" if os.name == "posix" else "spawn")
if os.name == "posix":
    FRESH.set_forkserver_preload([__name__])


class Alone(NgSpiceShared):
    LIBRARY_PATH = LIBRARY

    def __init__(self, external):
        self.said, self.external = [], external
        super().__init__()

    def send_char(self, message, ngspice_id):
        self.said.append(message)
        return 0

    def get_vsrc_data(self, voltage, time, node, ngspice_id):
        voltage[0] = np.interp(time, *self.external[node.lower()])
        return 0

    def do(self, command):
        try:
            return self.exec_command(command)
        except Exception:  # the wrapper takes any message on stderr for an error
            return self.stdout


def alone(folder, said, paths, external):
    """Loads each deck, runs it, stores its last plot and its step counts."""
    output = os.open(said, os.O_WRONLY | os.O_CREAT)
    for number in (1, 2):
        os.dup2(output, number)
    os.chdir(folder)
    logging.disable(logging.CRITICAL)
    ngspice: Any = Alone(external)
    for deck in paths:
        ngspice.said.clear()
        ngspice.do("source " + deck)
        ngspice.do("run")
        usage = ngspice.do("rusage all")
        count = {
            k: int(float(m.group(1)))
            for k, p in (
                ("accepted", "Accepted timepoints"),
                ("rejected", "Rejected timepoints"),
                ("iterations", "Total iterations"),
            )
            if (m := re.search(p + r" = (\S+)", usage))
        }
        plot = ngspice.plot(None, ngspice.last_plot)
        vectors: Any = {k: np.array(v._data) for k, v in plot.items()}
        np.savez(deck + ".npz", **vectors)
        Path(deck + ".json").write_text(json.dumps({"count": count, "log": ngspice.said}))


class Result(dict):
    """Vectors by lower-case name (branch currents as vemf#branch), `count`, `log`."""

    count: dict
    log: list


def run_all(folder, *decks, external=None) -> list[Result]:
    """Runs the decks (text) in `folder`, beside copies of the libraries. EXTERNAL sources named in
    `external` follow (t, value) points, joined by straight lines."""
    for library in CIRCUITS.glob("*.lib"):
        shutil.copy(library, folder)
    paths = []
    for number, deck in enumerate(decks):
        path = folder / f"deck{number}.cir"
        path.write_text(deck)
        paths.append(str(path))
    said = folder / "said"
    process = FRESH.Process(target=alone, args=(folder, said, paths, external or {}))
    process.start()
    process.join(120)
    process.kill()
    results = []
    for path in paths:
        if not Path(path + ".json").exists():
            raise AssertionError(f"ngspice failed:\n{said.read_text(errors='replace')[-4000:]}")
        with np.load(path + ".npz") as data:
            result = Result({k.lower(): data[k] for k in data.files})
        stored = json.loads(Path(path + ".json").read_text())
        result.count, result.log = stored["count"], stored["log"]
        results.append(result)
    return results


def run(folder, deck, external=None) -> Result:
    return run_all(folder, deck, external=external)[0]


def netlist(name, *edits, tran=None, options=None, **parameters):
    """A netlist with parameters overridden as the host does, lines replaced by expression."""
    text = (CIRCUITS / f"{name}.cir").read_text()
    edits = list(edits)
    edits += [(rf"^\.param {k}=.*$", f".param {k}={v!r}") for k, v in parameters.items()]
    if tran:
        edits.append((r"^\.tran.*$", tran))
    if options:
        edits.append((r"^\.options.*$", ".options " + options))
    for pattern, new in edits:
        text, number = re.subn(pattern, lambda m, new=new: new, text, flags=re.M)
        assert number == 1, f"{pattern} matches {number} lines of {name}.cir"
    return text


def opamp(kind, body, analysis, **parameters):
    """A bench for one operational amplifier at +-18 V; nodes inp, inn, out."""
    pins = "inp inn out vcc vee" + (" swing climit slewing" if kind == "opa548" else "")
    values = " ".join(f"{k}={v}" for k, v in parameters.items())
    return f"""bench
.include {kind}.lib
Vplus vcc 0 18
Vminus vee 0 -18
X1 {pins} {kind} {values}
{body}
.options reltol=1e-5 method=gear
{analysis}
.end
"""


def crossing(frequency, gain):
    """Frequency at which |gain| falls through one, on logarithmic axes."""
    level = np.log(np.abs(gain))
    k = np.flatnonzero((level[:-1] >= 0) & (level[1:] < 0))[-1]
    part = level[k] / (level[k] - level[k + 1])
    return float(np.exp(np.interp(part, [0, 1], np.log(np.abs(frequency[k : k + 2])))))
