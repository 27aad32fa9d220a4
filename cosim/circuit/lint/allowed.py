"""What a netlist may contain: its directives, options, models and characters.

A netlist can run commands, write files and read files while ngspice merely loads it: ``.control``,
``*#`` comments, a ``*ng_script`` title, code models, several device models and options. So this is
a list of what is allowed: only lines, words and characters that a circuit needs pass.
"""

import re

from cosim.circuit.dialect.lines import Line, refuse, shown
from cosim.circuit.dialect.words import word_set
from cosim.circuit.lint.elements import KINDS

MAX_WORD = 4_000
KEPT = word_set(
    ".param .subckt .ends .model .ic .nodeset .global .options .option .opt .temp "
    ".if .elseif .else .endif"
)
DROPPED = word_set(
    ".tran .op .ac .dc .tf .noise .disto .pz .sens .sp .four .fourier .meas .measure .save .print "
    ".plot .step .wave .probe .probe64 .width .title .csparam .backanno .prot .unprot .protect "
    ".unprotect .autoconverge .net .savebias"
)
"""Analyses, output and remarks: a host sets its own; see ``outputs.py``."""
NUMERIC_OPTIONS = word_set(
    "abstol bypass chgtol convabs convlimit convstep cshunt defad defas defl defw gmin gminsteps "
    "itl1 itl2 itl3 itl4 itl5 itl6 keepopinfo klu maxord method minbreak noopiter pivrel pivtol "
    "ramptime reltol rshunt scale seed sparse srcsteps temp tnom trtol trytocompact vntol "
    "xmu"
)
DROPPED_OPTIONS = word_set(
    "acct accurate advconv autostop baudrate brief cptime fastaccess filetype flagloads ingold "
    "interp limpts limtim list lvltim maxstep meascplxfmt measdgt noacct node noinit nomarch nomod "
    "nopage noprobe numdgt opts plotabstol plotreltol plotvntol plotwinsize post probe runlvl "
    "savecurrents skipbp srcstepmethod stepgmin thev_induc topologycheck warn width wnflag"
)
"""Options for output, which a host sets (``interp`` gives wrong waveforms), or other programs'."""
MODELS = word_set(" ".join(["vswitch iswitch", *(kind.models for kind in KINDS.values())]))
"""Not numd, nbjt, numos, whose cards name files, and no code models."""
MOS_LEVELS = frozenset("123469")
"""The BSIM models write a log into the working folder."""
_GATES = (
    "BUF, AND, OR, XOR of two, SCHMITT, SRFLOP and DFLOP of LTspice with Vhigh, Vlow, Ref, Vt, Vh, "
    "Td, Trise, Tfall, Tau, Rout, Cout"
)
_TEXT = re.compile(r"[ -~]*")  # printable ASCII
_UNSAFE = re.compile(r'["`\\]')
_FILE_WORD = re.compile(r"\b(?:\w*_)?(?:file|filename|wavefile)\b", re.IGNORECASE)
# A value in braces or quotes, or a number.
_VALUE = re.compile(r"\{[^{}]*\}|'[^']*'|[+-]?[\d.][\w.+-]*")
# A name, perhaps with "=" and a value in braces, quotes or bare, or with a number.
_OPTION = re.compile(
    r"([a-z_]\w*)(?:\s*=\s*(\{[^{}]*\}|'[^']*'|[\w.+-]+)|\s+([\d.][\w.+-]*))?[\s,]*", re.IGNORECASE
)
# The model's type, or "ako:BASE" with a type that may follow it.
_MODEL = re.compile(
    r"\.model\s+[^\s=(){}']+\s+(ako:[^\s(){}'=]+(?:\s+[a-z]\w*(?![\w:=]))?|[a-z]\w*)(?![\w:])",
    re.IGNORECASE,
)
_LEVEL = re.compile(r"(?<![\w.])level\s*(=?)\s*([^\s,()]*)", re.IGNORECASE)


def directive(line: Line) -> tuple[str, str]:
    """The dot word of a line, lower case, and what follows; no word for an element."""
    text = line.text.strip()
    if not text.startswith("."):
        return "", text
    match = re.match(r"\.[^\s=({'\"]*", text)
    word = match[0] if match else "."
    return word.lower(), text[len(word) :].strip()


def passed(line: Line) -> str | None:
    """The text of a logical line if ngspice may see it, None if it is dropped. Raises BadInput."""
    word, rest = directive(line)
    if "ng_script" in line.text.lower():
        refuse(line, "ng_script would make the netlist a script of commands")
    if word in DROPPED:
        return None
    if word == ".ends":
        return word  # libraries have remarks behind it
    if word == ".func":  # the others are .param lines by now
        refuse(
            line, f"{shown(line.text)} is no complete .func line; write .func NAME(X,...) {{...}}"
        )
    if word and word not in KEPT:
        till = ", and all up to .endc: a scene tells what is run" if word == ".control" else ""
        refuse(line, f"{shown(word)} is not allowed in a netlist; leave it out{till}")
    if not _TEXT.fullmatch(line.text) or _UNSAFE.search(line.text):
        odd = next(c for c in line.text if not " " <= c <= "~" or c in '"`\\')
        refuse(line, f"the character {shown(odd)} cannot stand in a netlist outside comments")
    if max(map(len, line.text.split())) > MAX_WORD:
        refuse(line, f"a word is longer than {MAX_WORD} characters")
    if found := _FILE_WORD.search(line.text):
        cure = "a netlist may not name files; write the values of this one into the line"
        refuse(line, f"{shown(found[0])} is not allowed, as {cure}")
    if word == ".temp" and not _VALUE.fullmatch(rest.lstrip("= ")):
        one = "must have one temperature in °C, a number or {…}"
        cure = "for several write {NAME}, and sweep over circuit.param.NAME"
        refuse(line, f".temp {shown(rest)}".rstrip() + f" {one}; {cure}")
    if word in (".options", ".option", ".opt"):
        return _options(line, word, rest)
    if word == ".model":
        return _model(line)
    if word == ".param" and not rest:
        return None
    if not word and line.text[0].lower() not in KINDS:
        name = line.text.split()[0]
        known = f" but {_GATES}" if name[0] in "aA" else ""
        cure = f"{'take a model for PSpice, or ' * bool(known)}write it with R, C and B sources"
        refuse(line, f"{shown(name)} is no element that a netlist may have{known}; {cure}")
    return line.text


def _options(line: Line, word: str, rest: str) -> str | None:
    kept: list[str] = []
    place = 0
    while place < len(rest):
        match = _OPTION.match(rest, place)
        if match is None:
            refuse(line, f"{shown(rest[place:])} is no option")
        name = match[1].lower()
        if name in NUMERIC_OPTIONS:
            if match[2] and name != "method" and not _VALUE.fullmatch(match[2]):
                refuse(line, f"{shown(match[0].strip())} must have a number, or a name in {{…}}")
            kept.append("=".join(filter(None, match.groups())))
        elif name not in DROPPED_OPTIONS and not name.startswith("dig"):
            refuse(line, f"the option {shown(name)} is not allowed in a netlist; leave it out")
        place = match.end()
    return f"{word} {' '.join(kept)}" if kept else None


def _model(line: Line) -> str:
    match = _MODEL.match(line.text)
    if match is None:
        refuse(line, f"{shown(line.text)} is no complete .model line")
    kind = match[1].lower().split()[-1]  # "ako:BASE" where no type follows it
    if kind not in MODELS and not kind.startswith("ako:"):
        refuse(line, f"models of type {shown(kind)} are not allowed in a netlist")
    if kind in MODELS - {"nmos", "pmos"}:
        return line.text
    for equals, level in _LEVEL.findall(line.text):
        if not equals or level not in MOS_LEVELS:
            refuse(line, f"MOS models of level {shown(level)} are not allowed: some write files")
    return line.text
