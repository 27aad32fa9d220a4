"""The scene file's keys as a JSON schema, for editors that complete and check TOML.

Source: JSON Schema, draft 2020-12. A scene is checked further as it is loaded: what two keys must
be together no schema says.
"""

from typing import Any

from cosim.scene.describe import Key, keys
from cosim.scene.tables import PORT_LISTS, TABLES

_TYPES = {bool: "boolean", int: "integer", float: "number", str: "string"}


def schema() -> dict[str, Any]:
    """The schema of a scene file; each key has its unit in its description."""
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
    for name, limit in (("minimum", key.low), ("maximum", key.high)):
        if limit is not None:
            about[name] = limit
    return about
