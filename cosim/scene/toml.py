"""Parses TOML from untrusted files, in a time that grows linearly with its length."""

import re
import tomllib
from pathlib import Path
from typing import Any

from cosim.errors import BadInput, plain
from cosim.files import reader

MOST_PARTS = 8
"""Most parts of a dotted key, of a scene's two; tomllib takes quadratic time: hours for 1 MB."""

LARGEST = 1 << 20
"""Bytes of a file; far above any honest one."""

# Strings of all four kinds and comments, also unfinished ones, which end with their line or file.
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


def read(path: Path | str) -> dict[str, Any]:
    """The content of a TOML file. Raises BadInput, Refused where it cannot be read."""
    raw, name = reader.read(path, LARGEST), plain(path)
    try:
        return parse(raw.decode("utf-8-sig"))  # editors on Windows like to add the mark
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise BadInput(f"{name}: line {line}: this is not UTF-8 text.") from None
    except RecursionError:
        raise BadInput(f"{name}: this is not TOML: too deeply nested.") from None
    except ValueError as error:
        why = plain(error)
        if why.startswith("Exceeds the limit"):  # Python's message means its own int()
            why = "a whole number in it has thousands of digits"
        raise BadInput(f"{name}: this is not TOML: {why}.") from None
