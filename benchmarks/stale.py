"""Which figures and tables in ``results/`` were made with another core than the one that is here.

``python -m benchmarks.stale`` tells it, and never fails; with names of files it notes that these
are made with the core as it is now. ``made.json`` keeps a digest of the core for each file.
"""

import argparse
import hashlib
import json
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CORE = (
    "fmu/src",
    "circuits",
    "cosim/coupling",
    "cosim/mechanics",
    "cosim/simulation",
    "cosim/stepper",
)
"""Folders of the sources on which every simulated number depends."""
SOURCES = {".c", ".h", ".def", ".cir", ".lib", ".py", ".toml"}
MADE = Path("benchmarks/made.json")


def core(root: Path = ROOT) -> str:
    """The digest of the core's sources."""
    found = hashlib.sha256()
    for folder in CORE:
        for path in sorted((root / folder).rglob("*")):
            if path.suffix in SOURCES:
                found.update(path.relative_to(root).as_posix().encode() + path.read_bytes())
    return found.hexdigest()[:16]


def made(files: list[str], root: Path = ROOT) -> None:
    """Record that ``files`` were made with the present core."""
    known = _known(root) | dict.fromkeys((Path(file).name for file in files), core(root))
    kept = {name: known[name] for name in sorted(known) if (root / "results" / name).exists()}
    (root / MADE).write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")


def stale(root: Path = ROOT) -> dict[str, list[str]]:
    """The files made with another core, by that core's digest; ``""`` if it is not known."""
    found: dict[str, list[str]] = defaultdict(list)
    known, now = _known(root), core(root)
    for path in sorted((root / "results").iterdir()):
        if path.is_file() and path.name != "README.md" and known.get(path.name) != now:
            found[known.get(path.name, "")].append(path.name)
    return found


def _known(root: Path) -> dict[str, str]:
    path = root / MADE
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def main() -> None:
    parser = argparse.ArgumentParser("benchmarks.stale", description=__doc__)
    parser.add_argument("files", nargs="*", help="these are made now")
    asked = parser.parse_args().files
    if asked:
        made(asked)
        return
    for digest, names in stale().items():
        other = f"core {digest}, not {core()}" if digest else "a core that is not known"
        print(f"results/ made with {other}: {' '.join(names)}")


if __name__ == "__main__":
    main()
