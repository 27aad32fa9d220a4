"""Descriptions of the keys, read from the tables, for messages, documentation and units."""

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
    """The FMU's variable that the key sets; empty without one."""
    words: str = ""
    """The allowed values in words, where neither kind nor choices say them."""

    @property
    def title(self) -> str:
        """The meaning, for an axis: ``text`` up to its first semicolon."""
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
        """The allowed values, as the end of "… must be …"."""
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
    """The description of a key of a table, or of a list of tables."""
    field = (TABLES | PORT_LISTS)[table].model_fields[name]
    kind = field.annotation
    if get_origin(kind) in (UnionType, Union):
        kind = next(arg for arg in get_args(kind) if arg is not type(None))
    limits = {k: getattr(m, k) for m in field.metadata for k in ("ge", "le") if hasattr(m, k)}
    extra: Any = field.json_schema_extra
    choices = get_args(kind) if get_origin(kind) is Literal else tuple(extra.get("enum", ()))
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
        choices=choices or None,
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
"""Every key of every table by its full name, in order."""


_LAWS = {
    ("mechanics.suspension", "cubic"): ("suspension_k2", "suspension_k3"),
    ("mechanics.suspension", "knee"): ("suspension_knee", "suspension_hardening"),
    ("mechanics.suspension", "repulsion"): ("suspension_repulsion", "suspension_distance"),
    ("mechanics.contact", "rigid"): ("restitution",),
    ("mechanics.contact", "compliant"): ("contact_stiffness", "contact_damping"),
}
ACT_WITH = {f"mechanics.{key}": choice for choice, own in _LAWS.items() for key in own} | {
    "run.step": ("run.solver", "fast")
}
"""Keys that act only with one value of another key: the other key, and that value. On circuit,
waveform and method :func:`acts` decides."""


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
        return rung.driven or key.name == "count"  # the energies include one ram per coil
    if key.table == "drive":
        if not rung.driven:
            return key.name in GIVEN_SURFACES.get(waveform, ())
        return key.name not in set().union(*GIVEN_SURFACES.values()) - {"frequency"}
    return True
