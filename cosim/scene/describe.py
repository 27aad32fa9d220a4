"""What the tables say about their keys, for messages, documentation and units."""

from dataclasses import dataclass
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin

from cosim.scene.rungs import CouplingMethod, Rung
from cosim.scene.tables import GIVEN_SURFACES, PORT_LISTS, TABLES


@dataclass(frozen=True)
class Key:
    """One key of a scene. ``choices`` is None for numbers; ``low`` and ``high`` otherwise."""

    table: str
    name: str
    unit: str
    default: float | int | bool | str | None
    kind: type
    choices: tuple[str | int, ...] | None
    low: float | None
    high: float | None
    text: str
    variable: str
    """The FMU's variable that the key is; empty where it is none."""
    words: str = ""
    """What may stand there, where neither kind nor choices say it."""

    @property
    def title(self) -> str:
        """What it is, for an axis: ``text`` without what it says after that."""
        return self.text.partition(";")[0]

    @property
    def full(self) -> str:
        """The key as an override spells it: ``table.key``."""
        return f"{self.table}.{self.name}"

    def holds(self, value: float) -> bool:
        """Whether a number is within its range."""
        return self.low is not None and self.high is not None and self.low <= value <= self.high

    @property
    def allowed(self) -> str:
        """What may stand there, as the end of "… must be …"."""
        if self.words:
            return self.words
        if self.choices:
            quoted = [f'"{one}"' if isinstance(one, str) else str(one) for one in self.choices]
            return quoted[0] if len(quoted) == 1 else f"one of {', '.join(quoted)}"
        if self.kind is str:
            return "the path of a file"
        if self.kind is bool:
            return "true or false"
        number = "a whole number" if self.kind is int else "a number"
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{number} from {self.low:g} to {self.high:g}{unit}"


def described(table: str, name: str) -> Key:
    """What the table, or the list of tables, says of one of its keys."""
    field = (TABLES | PORT_LISTS)[table].model_fields[name]
    kind = field.annotation
    if get_origin(kind) in (UnionType, Union):
        kind = next(arg for arg in get_args(kind) if arg is not type(None))
    limits = {k: getattr(m, k) for m in field.metadata for k in ("ge", "le") if hasattr(m, k)}
    extra: Any = field.json_schema_extra
    choices = get_args(kind) if get_origin(kind) is Literal else extra.get("choices")
    if choices and isinstance(choices[0], int):
        kind, limits = int, {"ge": min(choices), "le": max(choices)}
    elif choices:
        kind = str
    return Key(
        table=table,
        name=name,
        unit=str(extra.get("unit", "")),
        default=field.default,
        kind=kind if isinstance(kind, type) else list,
        choices=choices,
        low=limits.get("ge"),
        high=limits.get("le"),
        text=field.description or "",
        variable=str(extra.get("variable", "")),
        words=str(extra.get("words", "")),
    )


KEYS = {
    f"{table}.{name}": described(table, name)
    for table, model in TABLES.items()
    for name in model.model_fields
}
"""Every key by its full name."""


def keys() -> tuple[Key, ...]:
    """Every key of every table, in order."""
    return tuple(KEYS.values())


def acts(key: Key, rung: Rung, waveform: str, method: CouplingMethod) -> bool:
    """Whether a key has an effect with this rung, ``drive.waveform`` and coupling method."""
    if key.name in ("model", "waveform"):
        return True
    if key.table == "coupling":
        return rung.ngspice and (key.name == "method" or key.name in method.keys)
    if key.full == "run.tolerance":
        return rung.on_ladder
    if key.table == "circuit":
        return key.name in rung.keys - method.chooses
    if key.table == "coil":
        return rung.driven or key.name == "count"  # as many rams take part in the energies
    if key.table == "drive":
        if not rung.driven:
            return key.name in GIVEN_SURFACES.get(waveform, ())
        return key.name not in set().union(*GIVEN_SURFACES.values()) - {"frequency"}
    return True


_TYPES = {bool: "boolean", int: "integer", float: "number", str: "string"}


def schema() -> dict[str, Any]:
    """The scene file's keys as a JSON schema (draft 2020-12), by which editors complete and check
    TOML; units stand in the descriptions. A scene is checked further as it is loaded."""
    tables: dict[str, Any] = {
        name: {
            "type": "object",
            "description": (model.__doc__ or "").partition("\n")[0],
            "properties": {key.name: _property(key) for key in keys() if key.table == name},
            "additionalProperties": False,
        }
        for name, model in TABLES.items()
    }
    defined: dict[str, Any] = {}
    for name, model in PORT_LISTS.items():
        items = model.model_json_schema(by_alias=True)
        defined |= items.pop("$defs", {})
        tables[name] = {"type": "array", "items": items}
    text = {"type": "string"}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Scene of cosim",
        "type": "object",
        "properties": {
            "base": text | {"description": "Built-in scene whose values hold where none stand"},
            "name": text | {"description": "Of the scene; its file's without one"},
            "description": text | {"description": "Printed with each run"},
            **tables,
        },
        "additionalProperties": False,
        **({"$defs": defined} if defined else {}),
    }


def _property(key: Key) -> dict[str, Any]:
    unit = "" if key.unit in ("", "1") else f" [{key.unit}]"
    about: dict[str, Any] = {"description": f"{key.text}{unit}"}
    if key.default is not None:
        about["default"] = key.default
    if key.choices:
        return about | {"enum": [*key.choices]}
    if key.kind in _TYPES:
        about["type"] = _TYPES[key.kind]
    limits = {"minimum": key.low, "maximum": key.high}
    return about | {name: limit for name, limit in limits.items() if limit is not None}
