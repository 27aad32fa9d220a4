"""Foreign FMUs: unpacked, described, loaded. Nothing in their description is trusted unchecked."""

import math
import re
import tempfile
import zipfile
from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from copy import copy
from ctypes import c_void_p, cast
from dataclasses import dataclass
from functools import cache
from pathlib import Path, PurePosixPath
from stat import S_ISLNK
from typing import Any

import fmpy
from fmpy.model_description import ValidationError

from cosim.errors import BadInput, plain
from cosim.files import reader
from cosim.mechanics.fmi import SLAVES, Interface, unit
from cosim.scene.messages import PLAIN_NUMBER, ended, shown, suggestion

MOST_FILES, LARGEST = 10_000, 1 << 30
"""Limits of an FMU: number of files, and bytes once unpacked."""

MOST_VALUES, MOST_ELEMENTS = 4096, 1 << 20
"""Limits: values of all outputs of an FMU, each element of arrays counted; values of one array."""

_JOINED = ("input", "output", "parameter")
"""Variables that a scene can connect or set; arrays of other causalities may have any size."""

_KINDS_2 = {"Real": 0, "Integer": 6, "Enumeration": 6, "Boolean": 11}
_KINDS_3 = {
    **{"Float64": 0, "Float32": 1, "Int8": 2, "UInt8": 3, "Int16": 4, "UInt16": 5, "Int32": 6},
    **{"UInt32": 7, "Int64": 8, "Enumeration": 8, "UInt64": 9, "Boolean": 10},
}
"""Numbers of the types of values in ``loop.h``."""

FUNCTIONS = {2: {"Enumeration": "Integer"}, 3: {"Enumeration": "Int64"}}
"""The type whose functions set and read a type, where the names differ."""

_LONGEST = 600  # characters of a message

_ELEMENT = re.compile(r"(.*)\[(\d+)\]")


@dataclass(frozen=True)
class Variable:
    """A variable of an FMU whose values are numbers."""

    name: str
    reference: int
    type: str
    kind: int
    size: int
    unit: str
    causality: str
    variability: str
    start: tuple[float, ...]
    slope: str
    """Name of the output that is its derivative; empty without one."""
    low: float
    high: float
    items: tuple[int, ...]
    """The values of an enumeration."""

    @property
    def one(self) -> tuple[int, int]:
        """Identity of the variable, which may have several names (aliases)."""
        return self.kind, self.reference

    @property
    def real(self) -> bool:
        return self.kind < 2

    @property
    def continuous(self) -> bool:
        """Whether it may change continuously between communication points."""
        return self.real and self.variability == "continuous"


class Stranger:
    """An FMU's file, unpacked and described. Raises BadInput, naming the file."""

    def __init__(self, path: Path) -> None:
        self.name = plain(str(path))
        folder = str(path)
        if not path.is_dir():
            self._folder = tempfile.TemporaryDirectory(prefix="fmu-")
            folder = self._folder.name
            _unpack(path, folder, self.name)
        try:
            found: Any = fmpy.read_model_description(folder, validate=False)
        except Exception as error:
            why = f"its modelDescription.xml cannot be read ({_why(folder)})"
            raise self.bad(why) from error
        self.version = int(str(found.fmiVersion).partition(".")[0])
        if self.version not in SLAVES:
            raise self.bad(f"it is of FMI {found.fmiVersion}; it must be of FMI 2.0 or 3.0")
        if found.coSimulation is None:
            raise self.bad("it must be for co-simulation, and is not")
        self.abilities: Any = found.coSimulation
        varies = self.abilities.canHandleVariableCommunicationStepSize
        usual = found.defaultExperiment and not varies and found.defaultExperiment.stepSize
        self.step = 0.0
        """Its own step, s, of which communication steps must be multiples; 0 if not declared."""
        with suppress(ValueError):
            self.step = float(self.abilities.fixedInternalStepSize or usual or 0.0)
        self.token = found.instantiationToken
        self.variables = self._variables(found)
        self._texts = {
            each.name: each.valueReference
            for each in found.modelVariables
            if each.type == "String" and each.causality in ("input", "parameter") and not each.shape
        }
        """Value references of parameters and inputs that are strings."""
        self.feedthrough = {
            each.variable.name: {v.name for v in each.dependencies}
            for each in found.outputs
            if each.variable is not None and each.dependencies is not None
        }
        """The variables on which each output depends without delay, where the FMU declares it."""
        self.loaded = self._load(folder)

    def bad(self, reason: str) -> BadInput:
        """The error for this FMU: one printable line, since ``reason`` may hold the FMU's words."""
        line = "".join(each if each.isprintable() else " " for each in reason)[:_LONGEST]
        return BadInput(ended(f"{self.name}: {line}"))

    def _variables(self, found: Any) -> dict[str, Variable]:
        kinds = _KINDS_2 if self.version == 2 else _KINDS_3
        derivatives = {
            each.derivative.name: each.name
            for each in found.modelVariables
            if each.derivative is not None and each.causality == "output"
        }
        known = {}
        for each in found.modelVariables:
            if each.type not in kinds:
                continue
            size = math.prod(each.shape or (1,)) if each.causality in _JOINED else 1
            if not 0 <= size <= MOST_ELEMENTS:
                raise self.bad(f"{each.name} must have from 0 to {MOST_ELEMENTS} values")
            if not 0 <= each.valueReference < 1 << 32:
                raise self.bad(f"the valueReference of {each.name} must be from 0 to 4294967295")
            of: Any = each.declaredType or each
            try:
                start = tuple(_number(text) for text in str(each.start or "").split())
                low = float(each.min or of.min or -math.inf)
                high = float(each.max or of.max or math.inf)
                items = tuple(int(item.value) for item in getattr(of, "items", ()))
            except ValueError as error:
                raise self.bad(f"start, min or max of {each.name} is no number ({error})") from None
            start = start * size if len(start) == 1 else start
            known[each.name] = Variable(
                *(each.name, each.valueReference, each.type, kinds[each.type], size),
                unit(each),
                *(each.causality or "local", each.variability or "continuous"),
                start if len(start) == size else (0.0,) * size,
                *(derivatives.get(each.name, ""), low, high, items),
            )
            if each.causality == "output" and not (each.name + unit(each)).isprintable():
                raise self.bad(f"name and unit of {each.name} must be printable")
        outputs = [each for each in known.values() if each.causality == "output"]
        if sum(each.size for each in outputs) > MOST_VALUES:
            raise self.bad(f"its outputs have more than {MOST_VALUES} values")
        return known

    def _load(self, folder: str) -> Any:
        model = self.abilities.modelIdentifier
        names = {"instanceName": "cosim", "guid": self.token, "modelIdentifier": model}
        try:
            return SLAVES[self.version](**names, unzipDirectory=folder)
        except Exception as error:
            words = str(error).replace(folder, "…")
            _, lacks, function = words.partition("undefined symbol: ")
            if lacks:
                raise self.bad(f"its library lacks the function {function} of FMI") from error
            raise self.bad(f"it has no library that runs here ({words})") from error

    def find(self, name: str, causality: str, where: str) -> tuple[Variable, int]:
        """A variable with this causality, and the place of an array's element; ``where`` is the
        scene's key with its value, as a message has it."""
        found, place = self.variables.get(name), 0
        match = _ELEMENT.fullmatch(name)
        if found is None and match is not None:
            found, place = self.variables.get(match[1]), int(match[2])
        if found is None or found.causality != causality:
            able = [each.name for each in self.variables.values() if each.causality == causality]
            known = f" (it has {', '.join(able[:20]) or 'none'})"
            other = f", not its {found.causality}" if found else ""
            hint = "" if found else suggestion(name, able)
            said = f"{where} must be one of its {causality}s with numbers{other}"
            raise self.bad(said + (hint or known))
        if found.size > 1 and (match is None or found.name == name):
            raise self.bad(
                f"{where} has {found.size} values: write {found.name}[0] … [{found.size - 1}]"
            )
        if place >= found.size:
            few = f"{found.name} has {'one value' if found.size else 'no values'}, no [{place}]"
            many = f"its elements must be [0] … [{found.size - 1}]"
            raise self.bad(f"{where}: {many if found.size > 1 else few}")
        return found, place

    def instance(self, parameters: Mapping[str, Any], name: str = "cosim") -> Interface:
        """A new instance of this name with these start values of parameters, initialised."""
        messages: deque[str] = deque(maxlen=100)
        try:
            loaded = copy(self.loaded)
            loaded.instanceName = name
            made = Interface(self.version, loaded, messages)
            arrays: dict[str, list[Any]] = {}
            for key, value in parameters.items():
                self._set(made, key, value, arrays)
            made.initialise()
        except BadInput:
            raise
        except Exception as error:
            said = f": {messages[-1]}" if messages else f" ({str(error).rstrip('.')})"
            needs = "; it needs its tool, which cannot be started here"
            said += needs * bool(self.abilities.needsExecutionTool)
            raise self.bad(f"the FMU cannot be initialised{said}") from error
        return made

    def settable(self, name: str, where: str) -> tuple[Variable, int]:
        """A parameter or input that may have a start value, and the place of an array's element;
        ``where`` is what :meth:`find` takes."""
        known = self.variables.get(name) or self.variables.get(name.partition("[")[0])
        is_input = known is not None and known.causality == "input"
        found, place = self.find(name, "input" if is_input else "parameter", where)
        if found.variability == "constant":
            raise self.bad(f"{where}: it is a constant")
        return found, place

    def _set(self, made: Interface, name: str, value: Any, arrays: dict[str, list[Any]]) -> None:
        """Set one, or an element of an array; ``arrays`` has those that were set before."""
        where = f"[[fmu]] parameters {name} = {shown(value)}"
        if name in self._texts:
            if not isinstance(value, str):
                raise self.bad(f'{where} must be a text, "{value}"')
            made.raw.setString([self._texts[name]], [value])
            return
        if isinstance(value, str):
            self.settable(name, where)
            raise self.bad(f"{where} must be {PLAIN_NUMBER}, or true or false")
        found, place = self.settable(name, where)
        for other in arrays:
            if other != found.name and self.variables[other].one == found.one:
                raise self.bad(f"{where}: it is {other}, which has a value")
        values = arrays.setdefault(found.name, [*found.start])
        values[place] = _allowed(found, value, where, self)
        kind = FUNCTIONS[self.version].get(found.type, found.type)
        getattr(made.raw, f"set{kind}")([found.reference], values)

    def address(self, name: str) -> Any:
        """The address of a function of its library, by its FMI name without the prefix ``fmi2``."""
        function = f"fmi{self.version}{name}"
        try:
            return cast(getattr(self.loaded.dll, function), c_void_p).value or 0
        except AttributeError:
            raise self.bad(f"its library lacks the function {function}") from None


_WHOLE = {f"{'' if s else 'U'}Int{n}": (n, s) for n in (8, 16, 32, 64) for s in (True, False)}
"""Bits of each integer type, and whether it has a sign; FMI 2.0's has 32 with sign."""


def _allowed(found: Variable, value: Any, where: str, of: Stranger) -> Any:
    """A value that type, range and items of a variable allow. Raises BadInput for others."""
    if found.type == "Boolean":
        if value not in (0, 1):  # sweeps give numbers only
            raise of.bad(f"{where} must be true or false")
        value = bool(value)
    elif isinstance(value, bool):
        raise of.bad(f"{where} must be a number")
    elif not found.real:
        if value != int(value):
            raise of.bad(f"{where} must be a whole number")
        bits, signed = _WHOLE.get(found.type, (32, True))
        low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
        if not low <= value <= high:
            raise of.bad(f"{where} must be from {low} to {high}")
        if found.items and value not in found.items:
            raise of.bad(f"{where} must be one of {', '.join(map(str, found.items))}")
        value = int(value)
    if not found.low <= value <= found.high:
        raise of.bad(f"{where} must be from {found.low:g} to {found.high:g}")
    return value


def _why(folder: str) -> str:
    """What is wrong with a model description: the validation's words, since those of a Python
    exception mean nothing to a user."""
    try:
        fmpy.read_model_description(folder)
    except Exception as error:
        told = isinstance(error, (ValidationError, SyntaxError, OSError))
        if told or type(error) is Exception:
            return str(error).replace(folder, "…")
    return "it does not follow the standard"


def _number(text: str) -> float:
    truth = {"true": 1.0, "false": 0.0}
    return truth[text] if text in truth else float(text)


def _unpack(path: Path, folder: str, name: str) -> None:
    """Unpack an FMU, within the limits and without files outside of ``folder``."""
    try:
        with reader.opened(path, LARGEST) as file, zipfile.ZipFile(file) as archive:
            files = archive.infolist()
            if len(files) > MOST_FILES or sum(each.file_size for each in files) > LARGEST:
                raise BadInput(f"{name}: it unpacks to more than {MOST_FILES} files or 1 GB.")
            for each in files:
                place = PurePosixPath(each.filename.replace("\\", "/"))
                if place.is_absolute() or ".." in place.parts:
                    raise BadInput(f"{name}: it has a file outside itself, {plain(str(place))}.")
            archive.extractall(folder)
            _link(folder, [each.filename for each in files if S_ISLNK(each.external_attr >> 16)])
    except BadInput:
        raise
    except Exception as error:  # of zipfile, and of all that it unpacks with
        raise BadInput(f"{name}: this is no FMU ({plain(str(error))}).") from None


def _link(folder: str, names: list[str]) -> None:
    """Turn files into symbolic links: zipfile unpacks a link as a text with its target."""
    for path in [Path(folder, name) for name in names]:
        place = path.read_text("utf-8")
        path.unlink()
        path.symlink_to(place)
    for path in [Path(folder, name) for name in names]:
        if not path.resolve().is_relative_to(Path(folder).resolve()):
            raise ValueError(f"the link {path.name} leads outside")


def stranger(path: str) -> Stranger:
    """The FMU in a file, unpacked and loaded once per process while the file is unchanged."""
    try:
        about = Path(path).stat()
    except OSError as error:
        raise BadInput(f"{plain(path)}: cannot be read ({error.strerror}).") from None
    except ValueError:  # a NUL in it
        raise BadInput(f"{plain(path)}: it is no possible file name.") from None
    return _stranger(path, about.st_mtime_ns, about.st_size)


@cache
def _stranger(path: str, changed: int, size: int) -> Stranger:
    return Stranger(Path(path))
