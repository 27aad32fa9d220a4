"""A setting as a link: ``#scene=NAME&table.key=value&…``, the fragment of an address.

It may come from a stranger: the code that opens it must check its names and values.
"""

from collections.abc import Iterable
from urllib.parse import quote, unquote

from cosim.errors import BadInput, plain

LONGEST = 8000
"""Characters of a link; a shape of 64 corners takes some 3000."""

_MARK = "#scene="
_PLAIN = "[],"  # besides letters, digits and _.-~, as the page's own script writes them


def is_link(text: str) -> bool:
    """Whether a text is a link, with or without the address before it."""
    return _MARK in text


def parse(link: str) -> tuple[str, list[tuple[str, str]]]:
    """The scene's name, and keys and values as texts. Raises BadInput."""
    fragment = link[link.index("#") + 1 :]
    if len(fragment) > LONGEST:
        raise BadInput(f"The link is longer than {LONGEST} characters.")
    pairs: list[tuple[str, str]] = []
    for part in fragment.split("&"):
        key, equals, value = part.partition("=")
        if not (key and equals and value):
            raise BadInput(f'link: "{plain(part, 60)}" must be table.key=value.')
        if key in dict(pairs):
            raise BadInput(f"link: it has {plain(key, 60)} twice.")
        pairs.append((key, unquote(value)))
    (first, scene), *rest = pairs
    if first != "scene":
        raise BadInput(f'link: it must begin with #scene=NAME, not with "{plain(first, 60)}".')
    return scene, rest


def write(scene: str, values: Iterable[tuple[str, str]]) -> str:
    """The link of a scene's name, and of keys and values as texts."""
    pairs = [("scene", scene), *values]
    return "#" + "&".join(f"{key}={quote(value, safe=_PLAIN)}" for key, value in pairs)
