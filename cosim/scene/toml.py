"""TOML of strangers, parsed in a time that grows with its length."""

import re
import tomllib
from pathlib import Path
from typing import Any

from cosim.errors import BadInput, plain
from cosim.files import reader

MOST_PARTS = 8
"""Of a dotted key: a scene's have two. tomllib takes the square of their number: hours for 1 MB."""

LARGEST = 1 << 20
"""Bytes of a file of one's own bounds or forces."""

_STRINGS = re.compile(
    r'"""(?:[^\\]|\\.)*?(?:"{3,5}|\Z)'
    r"|'''.*?(?:'{3,5}|\Z)"
    r'|"(?:[^"\\\n]|\\[^\n])*(?:"|(?=\\?\n)|\\?\Z)'
    r"|'[^'\n]*(?:'|(?=\n)|\Z)"
    r"|#[^\n]*",
    re.DOTALL,
)
_DOTTED = re.compile(rf"(?<![\w-])(?:[\w-]++[ \t]*+\.[ \t]*+){{{MOST_PARTS}}}")


def parse(text: str) -> dict[str, Any]:
    """The content of TOML. Raises ValueError or RecursionError, as tomllib does."""
    bare = _STRINGS.sub(lambda found: "" if found[0].startswith("#") else "x", text)
    if _DOTTED.search(bare):
        raise ValueError(f"a key has more than {MOST_PARTS} parts")
    return tomllib.loads(text)


def read(path: Path) -> dict[str, Any]:
    """The content of a TOML file. Raises BadInput."""
    try:
        return parse(reader.read(path, LARGEST).decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise BadInput(f"{plain(path)}: is no valid TOML: {error}.") from error
