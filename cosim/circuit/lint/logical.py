"""From the bytes of a netlist's file to its logical lines, in ngspice's dialect."""

import re
from collections.abc import Iterator
from itertools import accumulate
from unicodedata import category

from cosim.circuit.dialect.lines import DEEPEST, MAX_LINE, Line, refuse, shown
from cosim.circuit.dialect.translate import in_ngspice

_COMMAND_COMMENT = re.compile(r"\*\s*(?:#\s*[\w!/.]|ng_script)", re.IGNORECASE)
_TRAILING = re.compile(r";|//|(?:^|(?<=[\s,]))\$")  # begins a comment; "$" only between words
_NUMBERED = re.compile(r"(?<![\w.])\$(?=n_\d)", re.IGNORECASE)  # begins PSpice's own nodes


def decoded(data: bytes) -> str:
    """The text of a file in UTF-8, or Windows' UTF-16 or code page 1252, with or without byte order
    mark; each line ends with a line feed."""
    coding = "utf-8-sig"
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        coding = "utf-16"
    elif data[1:2] == b"\0" or data[:1] == b"\0":
        coding = "utf-16-le" if data[1:2] == b"\0" else "utf-16-be"
    try:
        text = data.decode(coding)
    except UnicodeDecodeError:
        text = data.decode("cp1252", "replace")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def checked(data: bytes, name: str) -> str:
    """``decoded``, but a character that some program takes for a line's end, or does not show, is
    refused unless it is a line feed; ``passed`` refuses other control characters outside comments.
    """
    text = decoded(data).replace("\x1a", " ").replace("\f", " ")  # DOS's and printers' ends
    for place, char in enumerate(text):
        if char in "\0\v\x1c\x1d\x1e\x85" or category(char) in ("Cf", "Cs", "Zl", "Zp"):
            line = Line("", shown(name), text.count("\n", 0, place) + 1)
            refuse(line, f"the control character U+{ord(char):04X} cannot stand in a netlist")
    return text


def logical(text: str, file: str, first: int) -> Iterator[Line]:
    """The lines with content, translated to ngspice's dialect."""
    for line in _joined(text, file, first):
        # What follows looks for the end of each bracket anew, in a time quadratic in the depth.
        if max(accumulate((char in "({") - (char in ")}") for char in line.text)) > DEEPEST:
            refuse(line, f"brackets are nested more than {DEEPEST} deep")
        yield from in_ngspice(line)


def _joined(text: str, file: str, first: int) -> Iterator[Line]:
    """The lines without comments, continuations joined to what they continue."""
    pending: Line | None = None
    for place, raw in enumerate(text.split("\n"), first):
        content = _without_comment(Line(raw, file, place))
        if not content:
            continue
        line = Line(content, file, place)
        if content.startswith("+"):
            if pending is None:
                refuse(line, "the line continues nothing")
            content = f"{pending.text} {content[1:].strip()}"
            pending = Line(content, file, pending.number)
        else:
            if pending is not None:
                yield pending
            pending = line
        if len(content) > MAX_LINE:
            refuse(line, f"the line is longer than {MAX_LINE} characters")
    if pending is not None:
        yield pending


def _without_comment(line: Line) -> str:
    content = line.text.strip()
    if content.startswith("*"):
        if _COMMAND_COMMENT.match(content):
            refuse(line, "a comment that begins with *# or *ng_script is a command to ngspice")
        return ""
    content = _NUMBERED.sub("", content)
    end = _TRAILING.search(content)
    return " ".join((content[: end.start()] if end else content).split())
