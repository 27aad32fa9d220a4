"""One sentence for everything that can be wrong with a scene."""

import difflib
import re
from collections.abc import Iterable, Mapping
from math import inf
from numbers import Integral
from operator import attrgetter
from typing import Any

from pydantic import ValidationError

from cosim.errors import BadInput, plain
from cosim.scene.describe import ACT_WITH, KEYS, Key, acts, described
from cosim.scene.model import Scene, toml_value
from cosim.scene.rungs import METHODS, RUNGS
from cosim.scene.tables import GIVEN_SURFACES, PORT_LISTS, TABLES

ALLOWED_TOP = {
    "name": "at most 64 letters, digits, blanks and ._+- that begin with a letter or digit",
    "description": "one line of at most 200 characters",
}
ALLOWED_START = "a number, true, false or a text"
MOST_TOLD = 5
"""Most faults of a scene that one message tells."""

PLAIN_NUMBER = "a number without suffix or unit, such as 3e3"


def shown(value: object, limit: int = 60) -> str:
    """A value as its user wrote it, on one line and not too long."""
    try:
        text = toml_value(value) if isinstance(value, bool | int | float | str) else str(value)
    except ValueError:  # an int too long for str()
        text = "an endless number"
    text = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
    return text if len(text) <= limit else text[: limit - 1] + "…"


def suggestion(word: str, known: Iterable[str], what: str = "") -> str:
    """``; did you mean …?`` if something known looks like ``word``, else the empty string."""
    near = difflib.get_close_matches(word, list(known), n=1)
    return f"; did you mean {what}{near[0]}?" if near else ""


def full_name(bare: str) -> str:
    """``; did you mean table.key?`` if a key is called ``bare``, else the empty string."""
    full = next((key.full for key in KEYS.values() if key.name == bare), None)
    return f"; did you mean {full}?" if full else ""


def ended(sentence: str) -> str:
    """The sentence with a full stop, unless it is a question."""
    return sentence if sentence.endswith("?") else sentence + "."


def bad(sentence: str) -> BadInput:
    """A BadInput with the sentence, :func:`ended`."""
    return BadInput(ended(sentence))


def unknown_table(name: str) -> str:
    """A sentence on an unknown table, or on a key outside its table."""
    hint = (
        full_name(name)
        or suggestion(name, (*TABLES, "base", "description"))
        or f" (tables: {', '.join((*TABLES, *PORT_LISTS))}; above them: base, description)"
    )
    return f'there is no table "{plain(name)}"{hint}'


def unknown_key(table: str, name: str) -> str:
    """A sentence on a key that its table does not have."""
    known = [key.name for key in KEYS.values() if key.table == table]
    full = f"{table}.{name}"
    hint = (
        full_name(name)
        or suggestion(name, known, f"{table}.")
        or suggestion(full, KEYS)
        or f" (keys of {table}: {', '.join(known)})"
    )
    return f'there is no key "{plain(full)}"{hint}'


def idle(key: Key, scene: Scene) -> str:
    """A sentence on a key that has no effect in a scene; empty where it has one."""

    def listed(names: Iterable[str]) -> str:
        *rest, last = [f'"{name}"' for name in names]
        return f"{', '.join(rest)} or {last}" if rest else last

    lead = f"{key.full} has no effect with"
    if key.full in ACT_WITH:
        choice, acting = ACT_WITH[key.full]
        if (chosen := attrgetter(choice)(scene)) != acting:
            return f'{lead} {choice} = "{chosen}"; it acts with "{acting}"'
    rung, waveform, method = scene.rung, scene.drive.waveform, METHODS[scene.coupling.method]
    if acts(key, rung, waveform, method):
        return ""
    if key.table == "circuit" and key.name in method.chooses:
        return f'{lead} coupling.method = "{method.name}", which chooses it'
    if key.table == "coupling" and rung.ngspice:
        others = [name for name, other in METHODS.items() if key.name in other.keys]
        return f'{lead} coupling.method = "{method.name}"; it acts in {listed(others)}'
    at = f'circuit.model = "{rung.name}"'
    if key.table == "drive" and not rung.driven:
        at += f' and drive.waveform = "{waveform}"'
    able = [
        name
        for name, other in RUNGS.items()
        if not other.automatic  # an automatic one becomes one of the others
        and (other.ngspice if key.table == "coupling" else acts(key, other, "sawtooth", method))
    ]
    if able:
        return f"{lead} {at}; it acts in {listed(able)}"
    waveforms = [name for name, known in GIVEN_SURFACES.items() if key.name in known]
    return f'{lead} {at}; it acts in "none" with drive.waveform = {listed(waveforms)}'


def check_whole(option: str, value: Any, least: int, most: float = inf, why: str = "") -> None:
    """Raise BadInput for an option's value that is no whole number from ``least``, of which
    ``why`` tells more, to ``most``."""
    if not (isinstance(value, Integral) and least <= int(value) <= most):
        end = f" to {most}" if most < inf else ""
        raise BadInput(f"{option} {shown(value)}: must be a whole number from {least}{why}{end}.")


def explain(error: ValidationError, origins: Mapping[str, tuple[int, str]], default: str) -> str:
    """The first errors, at most :data:`MOST_TOLD`, in a sentence each, with the layers (files or
    options) that brought them in.

    ``origins`` gives, for each "table.key" that was set, the rank and the name of its layer.
    """
    told: dict[str, tuple[str, str]] = {}
    for each in error.errors(include_url=False):
        origin, sentence = _explained(each, origins, default)
        told.setdefault(sentence.partition(" = ")[0], (origin, ended(sentence)))  # once for a list
        if len(told) == MOST_TOLD:
            break
    said, last = "", None
    for origin, sentence in told.values():
        follows = re.sub("^there is", "There is", sentence)
        said += f" {follows}" if origin == last else f" {origin}: {sentence}"
        last = origin
    return said.strip()


def _explained(first: Any, origins: Mapping[str, tuple[int, str]], default: str) -> tuple[str, str]:
    """The layer that brought in an error, and a sentence on it."""
    if first["type"] == "check":
        layers = [origins[key] for key in first["ctx"]["keys"] if key in origins]
        return max(layers)[1] if layers else default, first["ctx"]["sentence"]
    if first["loc"][0] in PORT_LISTS:
        return origins.get(first["loc"][0], (0, default))[1], _of_list(first)
    full = ".".join(str(part) for part in first["loc"][:2])  # not the place in a list
    if first["type"] == "extra_forbidden":
        unknown = unknown_key if len(first["loc"]) > 1 else unknown_table
        return origins.get(full, (0, default))[1], unknown(*first["loc"])
    if full == "circuit.param" and len(first["loc"]) > 2:
        name = f"{full}.{first['loc'][2]}"
        origin = origins.get(name, origins.get(full, (0, default)))[1]
        return origin, f"{plain(name)} = {shown(first['input'])} must be {PLAIN_NUMBER}"
    key = KEYS.get(full)
    allowed = key.allowed if key else ALLOWED_TOP.get(full, "a table")
    hint = suggestion(shown(first["input"]).strip('"'), map(str, (key and key.choices) or ()))
    origin = origins.get(full, (0, default))[1]
    return origin, f"{full} = {shown(first['input'])} must be {allowed}{hint}"


def _of_list(fault: Any) -> str:
    """A sentence on a key of ``[[fmu]]`` or ``[[port]]``."""
    table, *place = fault["loc"]
    if len(place) < 2:
        if fault["type"] != "too_long":
            return f"{table} must be a list of tables, [[{table}]]"
        return f"[[{table}]] is given too often"
    fields = PORT_LISTS[table].model_fields
    if fault["type"] == "extra_forbidden":
        known = [each.alias or name for name, each in fields.items()]
        hint = suggestion(place[1], known) or f" (keys: {', '.join(known)})"
        return f'there is no key "{plain(place[1])}" in [[{table}]]{hint}'
    key = next(name for name, each in fields.items() if place[1] in (name, each.alias))
    allowed = described(table, key).allowed
    what = f"[[{table}]] {place[0] + 1}: {place[1]}"
    if len(place) > 2:
        what, allowed = f"{what}.{plain(place[2])}", ALLOWED_START
        if isinstance(fault["input"], dict) and fault["input"]:
            inner = next(iter(fault["input"]))
            allowed += f'; write a name with dots in quotes, "{plain(f"{place[2]}.{inner}")}"'
    if fault["type"] == "missing":
        return f"{what} is missing; it must be {allowed}"
    return f"{what} = {shown(fault['input'])} must be {allowed}"
