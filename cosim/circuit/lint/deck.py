"""Reads a netlist for ngspice; no other code passes a file's text to it.

Files are read and joined here, and only what ``allowed.py`` knows passes. ngspice sees neither
comments nor file names.
"""

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from cosim.circuit.dialect.functions import prelude
from cosim.circuit.dialect.lines import MAX_LINE, Line, refuse, shown, unusable
from cosim.circuit.dialect.models import in_ngspice_together
from cosim.circuit.dialect.parts import since_the_start
from cosim.circuit.dialect.words import definitions, number
from cosim.circuit.lint.allowed import directive, passed
from cosim.circuit.lint.logical import checked, decoded, logical
from cosim.errors import BadInput, plain
from cosim.files import reader

MAX_BYTES = 4_000_000
MAX_LINES = 100_000
MAX_DEPTH = 10
MAX_INCLUDES = 1_000
"""A file counts each time it is included; files that each include the next twice double that."""
MAX_NAMES = 1_000
"""File names that :func:`named` follows from one file."""


_INLINED = (".include", ".inc", ".lib")
# The parameter's name and the first value of its list or range.
_STEP = re.compile(
    r"\.step\s+(?:(?:oct|dec|lin)\s+)?param\s+([a-z_]\w*)\s+(?:list\s+)?([^\s{}'=]+)", re.IGNORECASE
)
_END = re.compile(r"^[ \t]*\.end\b(?![.\w])", re.IGNORECASE | re.MULTILINE)
_SCHEMATIC = re.compile(r"Version 4\S*\s+SHEET ")
_PIECE = r"""(?:"([^"\n]*)"|'([^'\n]*)'|([^\s"'()]+))"""  # a file's name, quoted or bare
_NAMES = re.compile(_PIECE)
_POINTS = re.compile(rf"(?<=pwl)([\s(]*)file\b\s*=?\s*{_PIECE}", re.IGNORECASE)  # PWL(file=NAME)
# What follows a directive or a key that names a file, to the end of the line.
_NAMED = re.compile(
    r"^[ \t]*\.(?:include|inc|lib)[\s+]+(.*)|\bfile\b[\s=+]*(.*)", re.IGNORECASE | re.MULTILINE
)
_ELSEWHERE = re.compile(r"[a-z]:|/|.*\.\.(?:/|$)", re.IGNORECASE)  # C:…, /… or ../
_STANDARD = re.compile(
    r"(?<![\w.-])(?:standard\.(?:bjt|dio|mos|jft|cap|ind|res|bead)|nom\.lib)\b", re.IGNORECASE
)
"""LTspice's and PSpice's own models, which they name whether they need them or not."""


def _beside(name: str) -> str:
    """A file's name relative to the file that names it. A path that leads elsewhere is cut to its
    last part, since programs write where a file lay on another machine."""
    plain = name.strip("\"' \t\r").replace("\\", "/")
    return plain.rpartition("/")[2] if _ELSEWHERE.match(plain) else plain


def named(path: Path) -> list[Path]:
    """The netlist and the files of its folder that it includes, directly or not: what a process in
    a sandbox must be allowed to read. Names that are not found are skipped; ``read`` refuses them.
    """
    folder, found, size = path.parent.resolve(), [path], 0
    for including in found:  # which grows meanwhile
        try:
            data = reader.read(including, MAX_BYTES - size)
            text = decoded(data)
        except (reader.Refused, OSError, ValueError):  # the last for a NUL in the name
            continue
        size += len(data)
        rests = ["".join(groups) for groups in _NAMED.findall(text)]
        pieces = ("".join(piece) for rest in rests for piece in _NAMES.findall(rest))
        names = {_beside(name) for name in (*rests, *pieces, *_STANDARD.findall(text))}
        for name in sorted(names)[:MAX_NAMES]:
            with suppress(OSError, ValueError, RuntimeError):
                file = (including.parent / name).resolve()
                if file not in found and file.is_relative_to(folder) and file.is_file():
                    found.append(file)
    return found


def read(path: Path) -> tuple[list[Line], list[Line]]:
    """The netlist with its includes inlined, a harmless title, then the lines that ngspice needs;
    and the lines that were left out.

    The text ends at ``.end``, which is not among the lines. Raises BadInput, beginning with
    ``file:line:``, for anything that is not plainly part of a circuit.
    """
    reading = _Reader(path)
    return reading.deck(), reading.dropped


@dataclass
class _Reader:
    """One ``read``: the folder that it must not leave, and how much it has read."""

    path: Path
    lines: list[Line] = field(default_factory=list)
    dropped: list[Line] = field(default_factory=list)
    bytes_read: int = 0
    includes: int = 0
    scope: tuple[int, ...] = ()
    """That of the lines at hand."""

    def deck(self) -> list[Line]:
        name = shown(self.path.name)
        text = self._top()
        if _END.search(text):  # without .end it may be any file, and no message may quote it
            title, _, rest = text.partition("\n")
            self.lines.append(Line(_title(Line(title, name, 1)), name, 1))
            if self._take(logical(rest, name, 2), (self.path,)):
                self.lines += self._stepped()
                every = in_ngspice_together(self.lines)
                self.dropped += [line for line in every if line.text.startswith(".told")]
                title, *lines = [line for line in every if not line.text.startswith(".told")]
                return [title, *prelude([title, *lines]), *lines]
        elif _SCHEMATIC.match(text):
            cure = "save what LTspice shows under View, SPICE Netlist, and name that file"
            refuse(Line("", name, 1), f"this is a drawing of LTspice and no netlist: {cure}")
        last = Line("", name, text.rstrip().count("\n") + 1)
        refuse(last, "the netlist does not end with .end, so it may be cut short")

    def _stepped(self) -> Iterator[Line]:
        """.param lines, with its first value, for each parameter that only a .step line defines."""
        known = {each.name for line in self.lines for each in definitions(line)}
        for line in self.dropped:
            step = _STEP.match(line.text)
            if step and step[1].lower() not in known:
                yield replace(line, text=f".param {step[1]}={step[2]}")

    def _top(self) -> str:
        """The text of the netlist itself."""
        name = plain(self.path)
        try:
            self.path = self.path.absolute()
            text = self._opened(self.path)
            self.folder = self.path.parent.resolve(strict=True)
            return text
        except reader.Refused as refused:
            missing = isinstance(refused.__cause__, FileNotFoundError | NotADirectoryError)
            reason = "there is no such file" if missing else f"cannot be read ({refused.why})"
            raise BadInput(f"{name}: {reason}.") from refused.__cause__
        except OSError as error:
            raise BadInput(f"{name}: cannot be read ({error.strerror}).") from error

    def _take(
        self, lines: Iterator[Line], opened: tuple[Path, ...], section: str | None = None,
        library: bool = False,
    ) -> bool:  # fmt: skip
        """Take the lines of a file, the last of ``opened``, or those of a ``section`` between .lib
        and .endl, or the definitions of a ``library``. Returns whether ``.end``, or the section,
        was found."""
        inside = section is None
        found = outside = False
        for line in lines:
            word, rest = directive(line)
            if section is not None and word in (".lib", ".endl"):
                name = rest.strip("\"' \t").lower()
                # A .lib with one word begins a section; with two it includes a file's section.
                if word == ".endl" or len(rest.split()) == 1:
                    inside = word == ".lib" and name == section
                    found = found or inside
                    continue
            if not inside:
                continue
            if word.startswith(".opt") and re.search(r"\bmaxstep\b", rest, re.IGNORECASE):
                told = ".told maxstep has no effect; circuit.max_step is a run's longest step"
                self._add(self.dropped, replace(line, text=told))
            if word in _INLINED:
                self._inline(line, rest, opened)
            elif word == ".end" and opened[1:]:  # libraries end subcircuits by it
                if self.scope:
                    self._keep(replace(line, text=".ends"), ".ends")
            elif word == ".end":
                for after in lines:
                    refuse(after, "there is text after .end, which must come last")
                return True
            elif library and not word and not self.scope:
                if not outside:
                    told = ".told parts outside subcircuits have no effect in a .lib, as in LTspice"
                    self._add(self.dropped, replace(line, text=f"{told}; .include takes them"))
                outside = True
            elif kept := self._passed(line, opened[-1]):
                self._keep(kept, word)
            else:
                self._add(self.dropped, line)
        return found

    def _passed(self, line: Line, base: Path) -> Line | None:
        """``passed``, but of a subcircuit, which nobody may need, only the use is to be refused."""
        try:
            text = passed(self._with_points(line, base))
            return None if text is None else replace(line, text=text)
        except BadInput as error:
            if not self.scope or directive(line)[0] in (".subckt", ".ends"):
                raise
            return unusable(line, error, ".unknown")

    def _keep(self, line: Line, word: str) -> None:
        """Take a line for ngspice, which begins with the directive ``word``."""
        if word == ".subckt":
            self.scope = (*self.scope, len(self.lines))
        elif word == ".ends":
            self.scope = self.scope[:-1]
        self._add(self.lines, replace(line, scope=self.scope))

    def _add(self, lines: list[Line], line: Line) -> None:
        if len(lines) >= MAX_LINES:
            refuse(line, f"the netlist with its includes has more than {MAX_LINES} lines")
        lines.append(line)

    def _inline(self, line: Line, rest: str, opened: tuple[Path, ...]) -> None:
        if standard := _STANDARD.search(rest):
            rest = standard[0]
            if not os.path.lexists(opened[-1].parent / rest):
                return  # if a model of it is needed, its use is refused
        pieces = ["".join(piece) for piece in _NAMES.findall(rest)]
        if len(pieces) > 2 or os.path.lexists(opened[-1].parent / _beside(rest)):
            pieces = [rest]  # a name with blanks
        if not 1 <= len(pieces) <= 1 + line.text.lower().startswith(".lib"):
            refuse(line, f"{shown(line.text)} does not name one file")
        name, section = pieces[0], "".join(pieces[1:]).lower() or None
        path = self._inside(line, name, opened[-1])
        if path in opened:
            refuse(line, f"{shown(name)} includes itself")
        if len(opened) >= MAX_DEPTH:
            refuse(line, f"files include each other more than {MAX_DEPTH} deep")
        self.includes += 1
        if self.includes > MAX_INCLUDES:
            refuse(line, f"files are included more than {MAX_INCLUDES} times")
        file = shown(path.relative_to(self.folder).as_posix())
        lines = logical(self._text(path, line), file, 1)
        library = line.text.lower().startswith(".lib") and not section
        if not self._take(lines, (*opened, path), section, library) and section:
            refuse(line, f"{shown(name)} has no section {shown(section)}")

    def _with_points(self, line: Line, base: Path) -> Line:
        """A source's line with the points of the file that its PWL names."""
        match = _POINTS.search(line.text) if line.text[0] in "vViI" else None
        if match is None:
            return line
        name = "".join(filter(None, match.groups()[1:]))
        points = re.findall(r"[^\s,()]+", self._text(self._inside(line, name, base), line))
        if len(points) % 2 or any(number(point) is None for point in points):
            refuse(line, f"{shown(name)} must hold pairs of numbers, a time and a value")
        text = f"{line.text[: match.end(1)]} {since_the_start(points)} {line.text[match.end() :]}"
        if len(text) > MAX_LINE:
            refuse(line, f"{shown(name)} has more than {MAX_LINE} characters: give it fewer points")
        return replace(line, text=text)

    def _inside(self, line: Line, name: str, base: Path) -> Path:
        """The regular file of this name, which must lie in the netlist's own folder."""
        name, given = _beside(name), name
        if not name.isprintable() or re.search(r"[:$~|*?<>`;]", name):
            refuse(line, f"{shown(name)} is no plain file name: rename the file")
        if _ELSEWHERE.match(given.strip("\"'").replace("\\", "/")):
            what = f"{shown(name)} is read from the netlist's folder, not from where its path leads"
            self._add(self.dropped, Line(f".told {what}", line.file, line.number))
        try:
            path = (base.parent / name).resolve(strict=True)
            if path.is_relative_to(self.folder) and path.is_file():
                return path
        except (OSError, ValueError, RuntimeError):
            refuse(line, f"{shown(name)} was not found in the netlist's folder: copy it there")
        refuse(line, f"{shown(name)} must be a file in the netlist's own folder")

    def _text(self, path: Path, line: Line) -> str:
        """The text of an included file."""
        try:
            return self._opened(path)
        except reader.Refused as refused:
            refuse(line, f"{shown(path.name)} cannot be read ({refused.why})")

    def _opened(self, path: Path) -> str:
        data = reader.read(path, MAX_BYTES - self.bytes_read)
        self.bytes_read += len(data)
        return checked(data, path.name)


def _title(line: Line) -> str:
    """The title as a comment, which ngspice takes for neither a script nor a directive."""
    title = line.text.strip()
    if "ng_script" in title.lower():
        refuse(line, "the title makes the netlist a script of commands")
    word, rest = directive(line)
    if word == ".title":
        title = rest
    elif word:
        refuse(line, f"the first line is the title and cannot be {shown(word)}")
    words = re.sub(r"[^\w ,.:()/+-]", " ", title, flags=re.ASCII).split()
    return f"* {' '.join(words)[:200] or 'netlist'}"
