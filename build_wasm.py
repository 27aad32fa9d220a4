"""Compiles the FMU's C to WebAssembly for the page of `cosim live`: `make wasm`.

Needs zig, as a tool only (pip install ziglang==0.17.1). What it makes is kept in the repository, so
that nobody else needs it; a test tells when it is older than the C that it was made of.
"""

import hashlib
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import build_c
from cosim.files.atomic import together
from cosim.mechanics.fmi import references

HERE = build_c.ROOT / "cosim/live/web"
TOKEN = "live"
LEAD = build_c.ROOT / "cosim/live/machine.c"
"""What the page calls, and what calls the FMU."""
CALLS = tuple(re.findall(r"^\w+ \*?(machine_\w+)\(", LEAD.read_text("utf-8"), re.MULTILINE))
FLAGS = (
    *("-target", "wasm32-wasi", "-mexec-model=reactor", "-std=c11", "-O2", "-ffp-contract=off"),
    *("-fno-math-errno", "-fno-trapping-math", "-Wl,--strip-all", f"-DFMU_TOKEN={TOKEN}"),
    *build_c.PLAIN_NAMES,
)


def files() -> list[Path]:
    """All that the page's machine is made of."""
    return sorted([LEAD, *build_c.fmu_sources(), *build_c.FMU.glob("src/*/*.[hd]*")])


def digest() -> str:
    """A hash of :func:`files` as they are now, with the flags."""
    found = hashlib.sha256(repr((FLAGS, CALLS)).encode())
    for path in files():
        found.update(path.name.encode() + b"\0" + path.read_bytes().replace(b"\r\n", b"\n"))
    return found.hexdigest()


def main() -> None:
    zig = [sys.executable, "-m", "ziglang"]
    version = subprocess.run([*zig, "version"], capture_output=True, text=True)
    if version.returncode:
        sys.exit("make wasm needs zig: .venv/bin/pip install ziglang==0.17.1")
    exports = [f"-Wl,--export={name}" for name in CALLS]
    code = [path for path in build_c.fmu_sources() if not path.name.startswith("fmi2")]
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder, "machine.wasm")
        include = f"-I{build_c.FMU / 'include'}"
        sources = map(str, (LEAD, *code))
        command = [*zig, "cc", *FLAGS, include, *exports, *sources, "-o", str(made)]
        subprocess.run(command, check=True)
        binary = made.read_bytes()
    about = {
        "sources": digest(),
        "zig": version.stdout.strip(),
        "sha256": hashlib.sha256(binary).hexdigest(),
        "references": references(3),
    }
    with together([HERE / "machine.wasm", HERE / "machine.json"]) as (wasm, told):
        wasm.write_bytes(binary)
        told.write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")
    print(f"{HERE / 'machine.wasm'}: {len(binary)} bytes")


if __name__ == "__main__":
    main()
