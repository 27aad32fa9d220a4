"""Docstrings as Markdown: their roles as code, their examples as blocks, their constants as
numbers."""

import re
from importlib import import_module
from typing import Any

from griffe import Extension, Object

ROLE = re.compile(r":\w+:`~?([^`]+)`")
EXAMPLE = re.compile(r"(?:^>>> .*\n?)(?:^(?!\s*$).*\n?)*", re.MULTILINE)
CONSTANT = re.compile(r"\b[A-Z][A-Z_]{2,}\b")


class Markdown(Extension):
    def on_object(self, *, obj: Object, **_: Any) -> None:
        if obj.docstring is None:
            return

        def number(match: re.Match[str]) -> str:
            """The value of a number that the module keeps under this name; else the name."""
            value = getattr(import_module(obj.module.path), match[0], None)
            if isinstance(value, float) and 0.0 < value < 1.0:
                return f"{100.0 * value:g} %"
            return f"{value:g}" if isinstance(value, int | float) else match[0]

        text = ROLE.sub(r"`\1`", obj.docstring.value)
        text = CONSTANT.sub(number, text)
        obj.docstring.value = EXAMPLE.sub(r"```pycon\n\g<0>\n```", text)
