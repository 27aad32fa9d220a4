"""Writes docs/reference/ and cosim/__init__.pyi from the tables that the program itself uses.

So a page and the program cannot part: a test holds the one against the other.
"""

import argparse
import json
import re
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

import cosim
from cosim.cli.main import _parser
from cosim.scene.describe import KEYS, Key
from cosim.scene.loading import list_scenes
from cosim.scene.rungs import METHODS, RUNGS
from cosim.scene.tables import PORT_LISTS, TABLES
from cosim.waveforms.columns import COLUMNS
from cosim.waveforms.formats import formats
from cosim.waveforms.quantities import SUMMARY

FOLDER = Path(__file__).parents[1] / "reference"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cell or ' ' for cell in line)} |" for line in lines) + "\n"


def pretty(unit: str) -> str:
    """A unit as print has it; nothing for a plain number."""
    if unit == "1":
        return ""
    for plain, better in (("Ohm", "Ω"), ("m1.5", "m^1.5^"), ("2", "²"), ("3", "³"), ("N.s", "N·s")):
        unit = unit.replace(plain, better)
    return unit.replace("m^1.5^", "m<sup>1.5</sup>").replace("deg", "°")


def sentence(text: str) -> str:
    """The text begun with a capital letter, with what Markdown takes for markup marked as text."""
    for plain, better in (("``", "`"), ("|", "\\|"), ("<", "&lt;")):
        text = text.replace(plain, better)
    text = re.sub(r"(?<=\d) us\b", " µs", " ".join(text.split()))
    first = text.partition(" ")[0]
    if "_" in first or first.startswith("ngspice"):  # names stay as they are
        return text
    return "FMU" + text[3:] if first.startswith("fmu") else text[:1].upper() + text[1:]


def number(value: float) -> str:
    return re.sub(r"e([+-])0*", lambda match: f"e{match[1].lstrip('+')}", f"{value:g}")


def code(value: object) -> str:
    """The value as code; in a table a bar must not look like the end of a cell."""
    text = str(value)
    return f"<code>{escape(text).replace('|', '&#124;')}</code>" if "|" in text else f"`{text}`"


# --- the scene ------------------------------------------------------------------------------------

REGISTRIES = {
    "circuit.model": (RUNGS, "How much of the circuit is modelled; the values stand below"),
    "coupling.method": (METHODS, "How circuit and mechanics are joined; the values stand below"),
}


_LISTS = {
    "drive.table": "`[[phase, level], …]`",
    "circuit.save": '`["v(out)", …]`',
    "circuit.param": "`{ NAME = number, … }`",
}


def default(key: Key) -> str:
    if key.default is None:
        return "none"
    if isinstance(key.default, bool):
        return code(str(key.default).lower())
    return code(f'"{key.default}"' if isinstance(key.default, str) else number(key.default))


def allowed(key: Key) -> str:
    if key.choices:
        return ", ".join(code(json.dumps(choice)) for choice in key.choices)
    if key.kind is bool:
        return "`true`, `false`"
    if key.kind is str:
        return "path of a file"
    if key.kind is list:
        return str(_LISTS[key.full])
    assert key.low is not None and key.high is not None
    whole = "whole, " if key.kind is int else ""
    return f"{whole}{number(key.low)} … {number(key.high)}"


def meaning(key: Key) -> str:
    text = REGISTRIES[key.full][1] if key.full in REGISTRIES else key.text
    rungs = [name for name, rung in RUNGS.items() if key.name in rung.keys]
    acts = f" Acts in {', '.join(rungs)}." if key.table == "circuit" and rungs else ""
    return sentence(text).removesuffix(".") + "." + acts


def _entry(name: str, about: FieldInfo) -> list[str]:
    """The row of a key of a list of tables."""
    extra = about.json_schema_extra
    words = str(extra.get("words", "number")) if isinstance(extra, dict) else "number"
    words = re.sub(r"\{.*\}", r"`\g<0>`", words)
    if about.default is PydanticUndefined:
        usual = "none" if about.default_factory else "needed"
    else:
        usual = "none" if about.default is None else code(json.dumps(about.default))
    return [code(name), sentence(about.description or "") + ".", usual, sentence(words)]


def scene() -> str:
    parts = [
        "# Scene keys",
        "A scene is a [TOML](https://toml.io) file with the tables below. It names only what "
        "differs from the scene given as `base`; without a `base` the defaults hold. "
        '`description = "…"` is printed with each run.',
        "All numbers are in SI units. Another value for one run: "
        "`cosim run SCENE --set table.key=value`.",
        "A key that has no effect with the scene's `circuit.model`, `drive.waveform` or "
        "`coupling.method` causes a note, except where ports join a circuit to FMUs. A value "
        "out of range is refused before anything runs.",
    ]
    for name, model in TABLES.items():
        parts += [f"## [{name}]", sentence((model.__doc__ or "").partition("\n")[0])]
        rows = [
            [code(key.name), meaning(key), default(key), pretty(key.unit), allowed(key)]
            for key in KEYS.values()
            if key.table == name
        ]
        parts.append(table(["key", "meaning", "default", "unit", "range"], rows))
        for full, (registry, _) in REGISTRIES.items():
            if full.startswith(f"{name}."):
                parts.append(f"The values of `{full}`:")
                rows = [[code(f'"{one.name}"'), sentence(one.text)] for one in registry.values()]
                parts.append(table(["value", "meaning"], rows))
    for name, model in PORT_LISTS.items():
        words = sentence((model.__doc__ or "").removesuffix("."))
        parts += [f"## [[{name}]]", f"{words}; one table for each. See [ports](../howto/ports.md)."]
        rows = [_entry(about.alias or key, about) for key, about in model.model_fields.items()]
        parts.append(table(["key", "meaning", "default", "value"], rows))
    return "\n\n".join(parts)


def scenes() -> str:
    rows = [[code(name), sentence(text)] for name, text in list_scenes()]
    return "\n\n".join(
        [
            "# Built-in scenes",
            "`cosim scenes` prints this list. Each is a file in `cosim/scene/library/`; each can "
            "be run, swept, tuned, and be the `base` of a scene of yours.",
            table(["scene", "what it is"], rows),
        ]
    )


# --- what a run leaves ----------------------------------------------------------------------------


def waveforms() -> str:
    rows = [[code(name), pretty(c.unit), sentence(c.text)] for name, c in COLUMNS.items()]
    return "\n\n".join(
        [
            "# Waveforms",
            "`waveforms.csv` and `waveforms.nc` (netCDF) hold the same columns, in SI units, with "
            "a row every `run.output_step`. In the CSV the head of a column is `name [unit]`. A "
            "run has no column for what it does not have: no `current` without a coil, no `z_ram` "
            "without a ram.",
            "Heights are absolute and grow upwards. `z_surface` is 0 where the flexures are "
            "unloaded. A row at a jump holds in all columns what is just before the jump.",
            table(["column", "unit", "meaning"], rows),
        ]
    )


def summary() -> str:
    rows = [[code(name), pretty(q.unit), sentence(q.text)] for name, q in SUMMARY.items()]
    return "\n\n".join(
        [
            "# Summary",
            "`summary.json` holds the numbers of a run, in SI units; `result.summary` is the same "
            "dictionary. Averages, extremes and counts are those after `run.settle`; energies and "
            "steps are those of the whole run. A run has no entry for what it does not have.",
            "The same names are the variables of a sweep, and what `cosim tune --maximise` takes.",
            table(["entry", "unit", "meaning"], rows),
        ]
    )


def exports() -> str:
    rows = [[code(name), code(one.file), sentence(one.help)] for name, one in formats().items()]
    parts = [
        "# Exports",
        "`cosim export RUN --as mat,wav` writes a finished run in the forms of other programs, "
        "from `waveforms.nc`, with all digits. A sweep's points it writes as `csv`, `mat` or, with "
        "the package pyarrow, `parquet`: a row for each.",
        table(["form", "file", "what it is"], rows),
    ]
    for name, one in formats().items():
        words = re.split(r"\n\s*\n", one.write.__doc__ or "")[0]
        parts += [f"## {name}", sentence(words)]
    return "\n\n".join(parts)


# --- the command line -----------------------------------------------------------------------------


def option(action: argparse.Action) -> list[str]:
    name = "/".join(action.option_strings) or str(action.metavar or action.dest)
    if action.option_strings and action.nargs != 0:
        words = action.metavar or "|".join(map(str, action.choices or [action.dest.upper()]))
        name += f" {words}"
    required = " Needed." if action.required and action.option_strings else ""
    text = sentence((action.help or "") % vars(action)).removesuffix(".") + "."
    return [code(name), text + required]


def command(parser: argparse.ArgumentParser, text: str, level: int) -> list[str]:
    hidden = (argparse._HelpAction, argparse._SubParsersAction)
    parts = [f"{'#' * level} {parser.prog}", sentence(text).removesuffix(".") + "."]
    rows = [option(action) for action in parser._actions if not isinstance(action, hidden)]
    if rows:
        parts.append(table(["argument", "meaning"], rows))
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            helps = {one.dest: one.help or "" for one in action._choices_actions}
            for name in sorted(action.choices):
                parts += command(action.choices[name], helps[name], level + 1)
    return parts


def command_line() -> str:
    parser = _parser(None)
    about = (
        "`python -m cosim` is the same command. `--help` after any of these prints its options. "
        "[The glossary](../glossary.md) explains the terms."
    )
    codes = table(
        ["exit code", "meaning"],
        [
            ["0", "done"],
            ["2", "bad input; one sentence on stderr says what is wrong; nothing was written"],
            ["3", "the simulation failed; the sentence says where, when, and what to try"],
            ["130", "interrupted; what was complete is kept"],
        ],
    )
    _, _, *rest = command(parser, "", 1)
    return "\n\n".join(["# Command line", about, codes, *rest])


# --- the library ----------------------------------------------------------------------------------

ERRORS = ("BadInput", "SimulationFailed")


def python() -> str:
    about = (
        "Everything that the command does, from a script, a notebook or standard input. The texts "
        "are in the built pages (`make docs`) and in Python: `help(cosim.run)`. Scenes are "
        "given by name, as a path of a TOML file, or as what `load` returned. Overrides are a "
        'mapping `{"table.key": value}`, SI. A message names an argument as the command does: '
        "`--budget` is `budget`."
    )
    return "\n\n".join(["# Python", about, *(f"::: cosim.{n}" for n in (*cosim.homes(), *ERRORS))])


def stub() -> str:
    """What `import cosim` has, for editors and type checkers."""
    homes = dict.fromkeys(ERRORS, "cosim.errors") | {"__version__": "cosim.version"} | cosim.homes()
    lines = [f"from {home} import {name} as {name}" for name, home in homes.items()]
    return "\n".join([*sorted(lines), "", "def homes() -> dict[str, str]: ..."])


PAGES = {
    "scene": scene,
    "scenes": scenes,
    "waveforms": waveforms,
    "summary": summary,
    "exports": exports,
    "command-line": command_line,
    "python": python,
}
"""The pages by the names of their files."""

NOTE = "made by docs/programs/reference.py"


def files() -> dict[Path, str]:
    """All that is written, by its place."""
    pages = {FOLDER / f"{name}.md": f"<!-- {NOTE} -->\n{page()}" for name, page in PAGES.items()}
    every = pages | {Path(cosim.__file__).with_name("__init__.pyi"): f"# {NOTE}\n{stub()}"}
    return {path: text.rstrip() + "\n" for path, text in every.items()}


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for path, text in files().items():
        path.write_text(text, encoding="utf-8")
