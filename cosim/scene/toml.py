"""TOML of strangers, parsed in a time that grows with its length."""

import re
import tomllib
from typing import Any

MOST_PARTS = 8
"""Of a dotted key: a scene's have two. tomllib takes the square of their number: hours for 1 MB."""

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

    def blank(found: re.Match[str]) -> str:
        return "" if found[0].startswith("#") else "x"

    if _DOTTED.search(_STRINGS.sub(blank, text)):
        raise ValueError(f"a key has more than {MOST_PARTS} parts")
    return tomllib.loads(text)
