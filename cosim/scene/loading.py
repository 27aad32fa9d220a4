"""Loading of scenes: a built-in one, a TOML file or a link, its base, and overrides on top."""

import os
import re
import tomllib
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from cosim.errors import BadInput, NoEffect, Note, plain
from cosim.files import link, reader
from cosim.files.resources import circuits, compiled_fmus
from cosim.scene import messages, toml
from cosim.scene.describe import ACT_WITH, KEYS
from cosim.scene.model import FITTED, Scene, toml_value
from cosim.scene.rungs import METHODS
from cosim.scene.tables import (
    KNOBS,
    NORMAL_FORCES,
    PATHS,
    TABLES,
)

_LIBRARY = Path(__file__).with_name("library")


@dataclass(frozen=True)
class _Layer:
    origin: str
    """The file or option, as messages name it."""
    tables: dict[str, Any]
    builtin: bool = False


def list_scenes() -> list[tuple[str, str]]:
    """Name and description of every built-in scene, the paper's first."""
    return [(name, str(_builtin(name).get("description", ""))) for name in _names()]


def _names() -> list[str]:
    """Names of the built-in scenes, the paper's first."""
    found = [path.stem for path in _LIBRARY.glob("*.toml")]
    return sorted(found, key=lambda name: (not name.startswith("paper"), name))


def _builtin(name: str) -> dict[str, Any]:
    """The content of a built-in scene's file."""
    return tomllib.loads((_LIBRARY / f"{name}.toml").read_text(encoding="utf-8"))


def groups() -> dict[str, list[str]]:
    """The names of the built-in scenes, grouped by purpose."""
    return tomllib.loads(_LIBRARY.with_name("groups.toml").read_text(encoding="utf-8"))


Overrides = Mapping[str, Any] | Iterable[str]
"""Values for keys: ``{"table.key": value}``, SI, or ``"table.key=value"`` as the command has it."""


def load(source: "Scene | str | os.PathLike[str]", overrides: Overrides | None = None) -> Scene:
    """The checked scene of a built-in name, a TOML file, a link (``#scene=NAME&table.key=value``)
    or another scene, with ``overrides`` on top: ``{"table.key": value}``, SI, or strings
    ``"table.key=value"``.

    A file may name a built-in scene as its ``base``; each layer changes only the keys that it
    gives. A knob of the device replaces its value from the layers below, and the other way round.
    Raises :class:`BadInput` with a sentence on each of the first things that are wrong.
    """
    if isinstance(source, Scene):
        layers = [_Layer(source.origin, source.as_given())]
    else:
        if not isinstance(source, str | bytes | os.PathLike):
            raise BadInput(f"{messages.shown(source)}: must be a scene, or the name of one.")
        layers = _layers(os.fsdecode(source))
    odd = isinstance(overrides, str | bytes) or hasattr(overrides, "ndim")  # an array of NumPy
    if odd or not isinstance(overrides or (), Iterable):
        given = messages.shown(overrides)
        raise BadInput(f"overrides: must be a mapping or a list of strings, not {given}.")
    base = layers[-1].origin
    if isinstance(overrides, Mapping):
        changes = _Layer("overrides", _tables(overrides.items(), "overrides"))
    else:
        changes = _Layer("--set", _tables(_parsed(overrides or ()), "--set"))
    given = source.given if isinstance(source, Scene) else {}
    if changes.tables:
        layers.append(changes)
        given = {**given, **dict.fromkeys(_origins([changes]), changes.origin)}
    scene = _checked(layers, base)
    _tell_doubts(scene, layers)
    return scene.of(base, given)


def changed(scene: Scene, values: Mapping[str, float | int | str | None], origin: str) -> Scene:
    """``scene`` with other values for some keys ("table.key", SI), checked like a loaded one.

    ``origin`` names in messages where the values come from. Raises :class:`BadInput`.
    """
    layer = _Layer(origin, _tables(values.items(), origin))
    # A table that stays the same is not checked again, but the scene as a whole is.
    below = {name: scene.table(name) for name in layer.tables}
    if "run" in below:
        below["run"] = scene.as_given()["run"]
    try:
        made = Scene.model_validate(vars(scene) | _merge([_Layer("", below), layer]))
    except ValidationError:
        made = _checked([_Layer(scene.origin, scene.as_given()), layer], origin)
    return made.of(scene.origin, scene.given)


def _layers(source: str) -> list[_Layer]:
    """The file of ``source`` on top of the built-in scenes that it starts from."""
    builtin = _names()
    if link.is_link(source):
        return _linked(source, builtin)
    if source in builtin:
        origin, path, data = f"scene {source}", _LIBRARY / f"{source}.toml", _builtin(source)
    else:
        origin, path = plain(source), Path(source)
        data = _read(source, origin, builtin)
    name = re.sub(r"[^\w.+-]+", "-", path.stem).strip("-.+")[:64]
    if not data:
        words = "this file says nothing, so each key has its default"
        warnings.warn(f"{origin}: {words}; cosim new writes one to begin with.", Note, stacklevel=3)
    data.setdefault("name", name or "scene")
    for table in TABLES.keys() & data.keys():
        if not isinstance(data[table], dict):
            given = messages.shown(data[table])
            raise BadInput(f"{origin}: {table} = {given} must be a table.")
    own = [circuits() / "ports", *compiled_fmus()] if source in builtin else []
    _find_files(data, path.parent, *own)
    base = data.pop("base", None)
    if base is None:
        return [_Layer(origin, data, source in builtin)]
    if base not in builtin:
        given = messages.shown(base)
        hint = messages.suggestion(given.strip('"'), builtin) or f" ({', '.join(builtin)})"
        what = f"base = {given} must be a built-in scene{hint}"
        raise messages.bad(f"{origin}: {what}")
    below = _layers(base)
    below[-1].tables.pop("description", None)
    return [*below, _Layer(origin, data, source in builtin)]


def _linked(source: str, builtin: list[str]) -> list[_Layer]:
    """The layers of a link: its built-in scene, and its values. A link may name no files: neither a
    scene file nor files that a scene reads."""
    name, pairs = link.parse(source)
    if name not in builtin:
        hint = messages.suggestion(name, builtin) or f" ({', '.join(builtin)})"
        raise messages.bad(f'link: there is no built-in scene "{plain(name, 60)}"{hint}')
    for key, _ in pairs:
        if tuple(key.split(".")) in PATHS:
            raise BadInput(f"link: {key} names a file, which no link can.")
    tables = _tables([(key, _value(value)) for key, value in pairs], "link")
    return [*_layers(name), *([_Layer("link", tables)] if tables else [])]


def to_link(scene: Scene) -> str:
    """The link with the fewest keys that loads to an equal scene, name and description aside.
    Raises BadInput where no built-in scene with some keys changed is equal."""
    wanted, found = _plain_values(scene), []
    for name in _names():
        there = _plain_values(load(name))
        changes = {key: value for key, value in wanted.items() if there.get(key) != value}
        made = link.write(name, [(key, _spelt(changes[key])) for key in sorted(changes)])
        found.append((len(changes), name != scene.name, made))
    for _, _, made in sorted(found):
        with suppress(BadInput), warnings.catch_warnings():
            warnings.simplefilter("ignore", NoEffect)
            if _plain_values(load(made)) == wanted:
                return made
    raise BadInput(f"{scene.origin}: no link makes it, for example since it names files.")


def _plain_values(scene: Scene) -> dict[str, Any]:
    """The values by "table.key" of :meth:`Scene.as_given`."""
    given = scene.as_given()
    return {f"{table}.{key}": value for table in TABLES for key, value in given[table].items()}


def _spelt(value: Any) -> str:
    """A value as a link has it: words without quotes, lists without blanks."""
    return value if isinstance(value, str) else toml_value(value).replace(" ", "")


_NO_SCENES = {
    suffix: f"a scene names it; cosim new --kind {kind} makes one to begin with"
    for suffix, kind in ((".cir", "circuit"), (".net", "circuit"), (".fmu", "fmu"))
} | {".csv": "cosim compare lays one over a recording, and drive.file moves the surface as one"}


def _read(source: str, origin: str, builtin: list[str]) -> dict[str, Any]:
    """The content of a scene file."""
    if how := _NO_SCENES.get(Path(source).suffix):
        raise BadInput(f"{origin}: must be a scene, a .toml: {how}.")
    if os.path.isfile(inside := os.path.join(source, "scene.toml")):
        raise BadInput(f"{origin}: must be a scene, a .toml: this run's is {plain(inside)}.")
    try:
        return toml.read(source)
    except reader.Refused as refused:
        if not isinstance(refused.__cause__, FileNotFoundError):
            raise
        hint = messages.suggestion(Path(source).stem, builtin, "the built-in scene ")
        if source.endswith(".toml") or os.sep in source:
            raise messages.bad(f"{origin}: there is no such file{hint}") from None
        if os.path.isfile(near := f"{os.path.splitext(source)[0]}.toml"):
            hint = f"; did you mean {plain(near)}?"
        hint = hint or f" (built-in: {', '.join(builtin)})"
        raise messages.bad(f'there is no built-in scene and no file "{origin}"{hint}') from None


def _parsed(overrides: Iterable[str]) -> Iterator[tuple[str, Any]]:
    """The keys and values of ``table.key=value`` options."""
    for text in overrides:
        if not isinstance(text, str):
            raise BadInput(f"overrides: {messages.shown(text)} must be a text, table.key=value.")
        full, equals, right = parted(text)
        table, _, key = full.partition(".")
        if not (equals and table and key):
            hint = messages.full_name(full)
            raise messages.bad(f"--set {plain(text)}: must be table.key=value{hint}")
        if not right.strip():
            raise BadInput(f"--set {plain(text)}: has no value.")
        yield full, _value(right.strip())


# fmu.NAME."PARAMETER"=VALUE, the parameter a TOML string.
_QUOTED = re.compile(r'\s*(fmu\.\w+\.)("(?:[^"\\]|\\.)*")\s*=(.*)', re.DOTALL)


def parted(text: str) -> tuple[str, str, str]:
    """``table.key=value`` split at "=". An FMU's parameter with "=" in its name is quoted."""
    if match := _QUOTED.fullmatch(text):
        return match[1] + str(_value(match[2])), "=", match[3]
    key, equals, value = text.partition("=")
    return key.strip(), equals, value


def _tables(values: Iterable[tuple[str, Any]], origin: str) -> dict[str, Any]:
    """The tables that pairs of ``table.key`` and a value give."""
    tables: dict[str, Any] = {}
    for full, value in values:
        if not isinstance(full, str):
            raise BadInput(f"{origin}: {messages.shown(full)} must be a text, table.key.")
        table, dot, key = full.partition(".")
        if not dot:
            hint = messages.full_name(full)
            raise messages.bad(f"{origin}: {plain(full)} must be table.key{hint}")
        if isinstance(value, os.PathLike):
            value = os.fspath(value)
        # numpy's numbers are no Python numbers
        tables.setdefault(table, {})[key] = value.tolist() if hasattr(value, "tolist") else value
    _find_files(tables, Path())
    return tables


def _find_files(tables: dict[str, Any], folder: Path, *more: Path) -> None:
    """Make paths of files absolute: in the first folder that has the file, else in ``folder``."""

    def found(file: str) -> str:
        there = (place / file for place in (folder, *more))
        return os.path.abspath(next(filter(os.path.exists, there), folder / file))

    for table, key in PATHS:
        path = tables.get(table, {}).get(key)
        if isinstance(path, str):
            tables[table][key] = found(path)
    fmus = tables.get("fmu")
    for fmu in fmus if isinstance(fmus, list) else ():
        if isinstance(fmu, dict) and isinstance(fmu.get("file"), str):
            fmu["file"] = found(fmu["file"])


_POINT = re.compile(r"[+-]?(\.\d+|\d+\.)(e[+-]?\d+)?", re.IGNORECASE)
"""A number with a point at its beginning or end, as people write it but TOML does not."""


def _value(text: str) -> Any:
    """The TOML value of ``text``; a string where it is none, such as a bare word."""
    try:
        data = toml.parse(f"value = {text}")
    except (ValueError, RecursionError):
        return float(text) if _POINT.fullmatch(text) else text
    return data["value"] if data.keys() == {"value"} else text  # the text had more lines


def _checked(layers: list[_Layer], default: str) -> Scene:
    """The scene of the layers; ``default`` is the origin of faults that no layer has."""
    try:
        return Scene.model_validate(_merge(layers))
    except ValidationError as error:
        raise BadInput(messages.explain(error, _origins(layers), default)) from None


_TWINS = {
    "drive": KNOBS | {key: knob for knob, key in KNOBS.items()},
    "friction": dict(zip(NORMAL_FORCES, reversed(NORMAL_FORCES), strict=True)),
}
"""By table: pairs of keys, both ways, of which a later layer's key removes the other below it."""


def _merge(layers: list[_Layer]) -> dict[str, Any]:
    merged: dict[str, Any] = {}
    for layer in layers:
        for table, content in layer.tables.items():
            if table == "fmu" and isinstance(content, dict):
                merged[table] = _with_parameters(merged.get(table, []), content, layer.origin)
                continue
            if table not in TABLES:
                merged[table] = content
                continue
            below = merged.setdefault(table, {})
            twins = _TWINS.get(table, {})
            for key in twins.keys() & content.keys():
                below.pop(twins[key], None)
            below.update(content)
    return merged


def _with_parameters(
    fmus: list[dict[str, Any]], given: dict[str, Any], origin: str
) -> list[dict[str, Any]]:
    """The FMUs with the parameters ``given`` changed: ``{"name.parameter": value}``."""
    for fmu in fmus:
        if not isinstance(fmu.get("name"), str) or not isinstance(fmu.get("parameters", {}), dict):
            return fmus  # the scene's check will refuse it
    found = [fmu | {"parameters": {**fmu.get("parameters", {})}} for fmu in fmus]
    by_name = {fmu["name"]: fmu for fmu in found}
    for key, value in given.items():
        name, dot, parameter = key.partition(".")
        if not dot:
            words = "fmu must be a list of tables, [[fmu]]; a parameter is fmu.name.parameter"
            raise BadInput(f"{origin}: {words}.")
        if name not in by_name:
            known = ", ".join(map(str, by_name)) or "none"
            raise BadInput(f"{origin}: fmu.{plain(key)}: there is no such FMU (known: {known}).")
        if not isinstance(value, str | int) and not (isinstance(value, float) and isfinite(value)):
            what = f"fmu.{plain(key)} = {messages.shown(value)}"
            raise BadInput(f"{origin}: {what} must be {messages.ALLOWED_START}.")
        by_name[name]["parameters"][parameter] = value
    return found


def _origins(layers: list[_Layer]) -> dict[str, tuple[int, str]]:
    """For each key the rank and origin of the layer that gave it."""
    origins: dict[str, tuple[int, str]] = {}
    for rank, layer in enumerate(layers):
        for table, content in layer.tables.items():
            keyed = table in (*TABLES, "fmu") and isinstance(content, dict)
            names = [f"{table}.{key}" for key in content] if keyed else [table]
            origins |= dict.fromkeys(names, (rank, layer.origin))
    return origins


FAR = 300.0
"""A length, mass or inductance of so many times its default is likely in mm, g or mH."""


def _tell_doubts(scene: Scene, layers: list[_Layer]) -> None:
    """Warn of each key that the user changed although circuit, waveform or method ignore it, and of
    lengths, masses and inductances that are likely not in SI units.

    No warning where a later layer chose circuit, waveform or method, nor for a scene.toml, which
    has every key.
    """
    origins = _origins(layers)
    every = [
        key
        for key in KEYS.values()
        if key.default is not None and key.name not in FITTED | _TWINS.get(key.table, {}).keys()
    ]
    silent = [
        layer.builtin or all(key.name in layer.tables.get(key.table, {}) for key in every)
        for layer in layers
    ]
    for key in KEYS.values():
        rank, origin = origins.get(key.full, (-1, ""))
        if rank < 0 or silent[rank]:
            continue
        given = [layer.tables.get(key.table, {}) for layer in layers[: rank + 1]]
        values = [key.default, *(table[key.name] for table in given if key.name in table)]
        if values[-1] == values[-2]:
            continue
        usual = float(key.default or 0.0) if key.unit in ("m", "kg", "H") else 0.0
        if 0.0 < FAR * usual <= values[-1]:
            words = f"{key.full} = {values[-1]:g} {key.unit} is far from the usual {usual:g}"
            warnings.warn(f"{origin}: {words}; keys are in SI units.", Note, stacklevel=3)
        choices = [ACT_WITH.get(key.full, ("circuit.model", ""))[0]]
        choices += ["drive.waveform"] * (key.table == "drive")
        steered = key.table == "circuit" and key.name in METHODS[scene.coupling.method].chooses
        choices += ["coupling.method"] * (steered or key.table == "coupling")
        latest = max(origins.get(choice, (-1, ""))[0] for choice in choices)
        if rank < latest or scene.has_ports:  # keys of the built-in machine mean nothing there
            continue
        if idle := messages.idle(key, scene):
            warnings.warn(f"{origin}: {idle}.", NoEffect, stacklevel=3)
