"""Compiles the C of this project; runs when the package is installed or its wheel is built.

`make(folder)` writes:

    loop.so and other  libraries of the package, loaded by cosim.toolchain.libraries
    fmi2/, fmi3/       the FMU of the mechanics for FMI 2.0 and 3.0, as its .fmu files hold it
    models/            the other FMUs of FMI 3.0, unpacked; they belong to scenes of the library
    netlist.so         what makes an FMU of a netlist
    build.json         a hash of all that this was made of, the compiler and its flags, the size and
                       hash of each file, by which a damaged one is told from a whole one, and the
                       functions and structures of each library, as its C declares them

The same sources, compiler and flags give the same bytes.

COSIM_TARGET, "aarch64-linux" for one, names another platform to compile for; CC then makes code for
that one, and CC_FOR_BUILD for this machine.
"""

import ctypes
import hashlib
import json
import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent
FMU = ROOT / "fmu"
MODEL = "stickslip"
LIBRARIES = {
    "loop": tuple(
        ROOT / "cosim" / folder for folder in ("drive", "coupling/loop", "simulation/rungs")
    ),
    "part": (ROOT / "cosim/mechanics",),
    "stepper": tuple(ROOT / "cosim" / folder for folder in ("stepper", "studies/identify/chain")),
}
"""The package's libraries; each is made of all C files of its folders. Those come first whose
structures others hold."""
DESCRIBE = FMU / "src/fmi/describe.c"
THIN = tuple(FMU / folder for folder in ("thin", "netlist", "models"))
"""What makes FMUs of models with numbers alone, and those models."""
FMU_LICENSE = FMU / "LICENSE"

# Without contraction every platform computes the same bits. The other two -fno leave them as they
# are, and let roots and choices be vector code.
FLAGS = (
    *("-std=c11", "-O3", "-Wall", "-Wextra"),
    *("-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"),
)


def _this_platform() -> str:
    system = {"win32": "windows", "darwin": "darwin"}.get(sys.platform, "linux")
    arm = platform.machine().lower() in ("aarch64", "arm64")
    processor = "aarch64" if arm else "x86_64" if sys.maxsize > 2**32 else "x86"
    return f"{processor}-{system}"


CROSS = "COSIM_TARGET" in os.environ
TARGET = os.environ["COSIM_TARGET"] if CROSS else _this_platform()
"""The platform, by its name in FMI 3.0."""
PROCESSOR, SYSTEM = TARGET.split("-")
# Older systems have threads in a library of their own.
THREADS = () if SYSTEM == "windows" else ("-pthread",)
LOADER = ("-ldl",) if SYSTEM == "linux" else ()
LIBRARY_FLAGS = ("-fPIC", "-fvisibility=hidden")
HARDENING = (
    ("-fstack-protector-strong",),
    ("-U_FORTIFY_SOURCE", "-D_FORTIFY_SOURCE=3"),
    ("-U_FORTIFY_SOURCE", "-D_FORTIFY_SOURCE=2"),
    ("-Wl,-z,relro,-z,now",),
    ("-Wl,-z,noexecstack",),
)
"""Against faults in the C; taken where compiler and linker have them, the first of each kind. Not
-fcf-protection: with it a run on the rung "limited" seemed to take 2 % longer (a noisy machine)."""
# A shared library has FMI's functions by their plain names; source code has them with a prefix.
PLAIN_NAMES = ("-DFMI2_OVERRIDE_FUNCTION_PREFIX", "-DFMI3_OVERRIDE_FUNCTION_PREFIX")
SUFFIX = {"windows": ".dll", "darwin": ".dylib"}.get(SYSTEM, ".so")

PATIENCE = 300
"""s that a compiler has for one file; a second is usual."""


class BuildFailed(Exception):
    """Why nothing was made, in one sentence."""


def sources() -> list[Path]:
    """All files that the products depend on."""
    kinds = ("*.[ch]", "*.def")
    code = [path for of in LIBRARIES.values() for kind in kinds for path in _code(of, kind)]
    code += [path for kind in kinds for path in _code(THIN, kind)]
    return sorted([*code, *_fmu_files(), DESCRIBE, FMU_LICENSE, Path(__file__)])


def digest() -> str:
    """A hash of the sources as they are now; `build.json` holds that of the last build."""
    return _hash(sources())


def _recipe() -> dict[str, Any]:
    """What the products are made of and by, beside this module."""
    flags = [*FLAGS, *hardening()]
    return {"sources": digest(), "compiler": compiler_version(), "flags": flags}


def made(folder: Path) -> bool:
    """Whether `folder` holds what `make` would put there, each file whole."""
    try:
        about = json.loads((folder / "build.json").read_text())
        files = about["files"].items()
        whole = all(_sum((folder / name).read_bytes()) == known for name, (_, known) in files)
        return whole and _recipe().items() <= about.items()
    except (OSError, ValueError, KeyError):
        return False


def make(folder: Path) -> None:
    """Compile everything into `folder`, which is replaced as a whole or left as it is."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    with (
        _alone(folder.parent),
        tempfile.TemporaryDirectory(dir=folder.parent, prefix=".compile-") as name,
    ):
        work, new = Path(name), Path(name) / "new"
        new.mkdir()
        for library, folders in LIBRARIES.items():
            objects = _objects(_code(folders, "*.c"), work)
            made = work / (library + SUFFIX)  # some linkers leave more files beside it
            link(objects, made, "-shared", *THREADS)
            made.rename(new / made.name)
        _make_fmu(new, work)
        _make_thin(new, work)
        about = _recipe()
        about["interfaces"] = {name: interface(folders) for name, folders in LIBRARIES.items()}
        about["files"] = {
            path.relative_to(new).as_posix(): [path.stat().st_size, _sum(path.read_bytes())]
            for path in sorted(new.rglob("*"))
            if path.is_file()
        }
        (new / "build.json").write_text(json.dumps(about, indent=1) + "\n")
        for path in new.rglob("*"):
            if path.is_file():  # else, after a loss of power, names may be there and contents not
                with open(path, "rb+") as file:
                    os.fsync(file.fileno())
        if folder.exists():
            folder.rename(work / "old")
        new.rename(folder)


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Wait until no other build works in `folder`, and remove what killed ones have left there."""
    try:
        import fcntl
    except ImportError:  # Windows
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):  # a file system without locks
            fcntl.flock(handle, fcntl.LOCK_EX)
        for left in folder.glob(".compile-*"):
            shutil.rmtree(left, ignore_errors=True)
        yield
    finally:
        os.close(handle)


def compiler(variable: str = "CC") -> list[str]:
    """The command in CC, or the machine's cc, gcc or clang."""
    chosen = shlex.split(os.environ.get(variable, ""))
    if chosen:
        return chosen
    for name in ("cc", "gcc", "clang"):
        if shutil.which(name):
            return [name]
    raise BuildFailed("No C compiler was found; install gcc or clang, or name one in CC.")


@cache
def hardening() -> tuple[str, ...]:
    """The flags of HARDENING with which a small library can be made without a warning."""
    taken: dict[str, tuple[str, ...]] = {}
    with tempfile.TemporaryDirectory() as name:
        probe = Path(name, "probe.c")
        probe.write_text(_PROBE)
        for flags in HARDENING:
            if flags[0] not in taken:
                command = (*compiler(), *FLAGS, *LIBRARY_FLAGS, "-Werror", *flags, str(probe))
                with suppress(BuildFailed):
                    _run(*command, "-shared", "-o", str(probe.with_suffix(SUFFIX)))
                    taken[flags[0]] = flags
    return tuple(flag for flags in taken.values() for flag in flags)


_PROBE = """#include <string.h>
int shared(const char *from);
int shared(const char *from)
{
    char room[64];
    strcpy(room, from);
    return room[0] + room[63];
}
"""


def compiler_version() -> str:
    """The first line of what the compiler says of itself."""
    return _run(*compiler(), "--version").decode(errors="replace").split("\n")[0]


def link(inputs: list[Path], target: Path, *flags: str) -> None:
    """Make a program, or with ``-shared`` a library, of objects or C files."""
    sources = map(str, inputs)
    # A library of macOS has its own name inside: not where it was made.
    named = SYSTEM == "darwin" and "-shared" in flags
    name = (f"-Wl,-install_name,@rpath/{target.name}",) if named else ()
    _run(*compiler(), *FLAGS, *hardening(), *sources, "-o", str(target), *flags, *name, "-lm")


def _link_here(files: list[Path], target: Path, *flags: str) -> None:
    """What must run while others are compiled for another platform."""
    code = map(str, files)
    _run(*compiler("CC_FOR_BUILD"), "-std=c11", "-O1", *flags, *code, "-o", str(target), "-lm")


def _code(folders: tuple[Path, ...], pattern: str) -> list[Path]:
    return [path for folder in folders for path in sorted(folder.glob(pattern))]


def _objects(files: list[Path], work: Path, *flags: str) -> list[Path]:
    def compiled(file: Path) -> Path:
        target = work / f"{file.parent.name}-{file.stem}.o"
        command = (*compiler(), *FLAGS, *hardening(), *LIBRARY_FLAGS, *flags)
        _run(*command, "-c", str(file), "-o", str(target))
        return target

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(compiled, files))


def _run(*command: str) -> bytes:
    try:
        done = subprocess.run(
            command, stdin=subprocess.DEVNULL, capture_output=True, check=False, timeout=PATIENCE
        )
    except subprocess.TimeoutExpired as error:
        raise BuildFailed(
            f"{command[0]} did not end within {PATIENCE} s: {command[-1]}."
        ) from error
    except OSError as error:
        raise BuildFailed(f"{command[0]} cannot be run: {error.strerror}.") from error
    if done.returncode:
        lines = done.stderr.decode(errors="replace").splitlines()
        first = next((line for line in lines if "error" in line), lines[0] if lines else "")
        raise BuildFailed(f"{command[0]} failed: {first}")
    return done.stdout


def _sum(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _hash(files: list[Path]) -> str:
    digest = hashlib.sha256(repr((FLAGS, LIBRARY_FLAGS)).encode())
    for file in files:
        data = file.read_bytes()
        digest.update(f"{file.relative_to(ROOT).as_posix()} {len(data)}\n".encode() + data)
    return digest.hexdigest()


# ---- what Python has to know of a library ----

_COMMENTS = re.compile(r"/\*.*?\*/", re.DOTALL)
_ENUMS = re.compile(r"enum \{([^{}#]*)\};")
_STRUCTURES = re.compile(r"typedef struct(?: \w+)? \{([^{}]*)\} (\w+);")
_EXPORTS = re.compile(r"EXPORT (\w+) (\w+)\(([^()]*)\)")
_NUMBERS = {"void", "char", "bool", "int", "long", "int32_t", "int64_t", "double"}
_POINTERS = {"AnyFunction"}
"""Types that are pointers under a name."""


def interface(folders: tuple[Path, ...]) -> dict[str, Any]:
    """The structures and exported functions that the C in some folders declares, in its order: of a
    structure each field's name, type and lengths (as an array), of a function its result and its
    arguments. A type is a number's of C, ``*`` for any pointer, ``()`` for a pointer to a function
    without arguments and result, or a structure. What has other types or lengths is left out.
    """
    files = [*_code(folders, "*.h"), *_code(folders, "*.c")]
    text = _COMMENTS.sub("", "\n".join(file.read_text(encoding="utf-8") for file in files))
    lengths: dict[str, int] = {}
    for values in _ENUMS.findall(text):
        following = 0
        for name, _, value in (one.partition("=") for one in values.split(",") if one.strip()):
            lengths[name.strip()] = following = int(value.strip() or following)
            following += 1
    structures: dict[str, Any] = {}
    for body, name in _STRUCTURES.findall(text):
        fields = [each for line in body.split(";") for each in _fields(line, lengths)]
        if all(kind in {*_NUMBERS, *structures, "*", "()"} for _, kind, _ in fields):
            structures[name] = fields
    functions = {
        name: [result, [_argument(one) for one in arguments.split(",") if one != "void"]]
        for result, name, arguments in _EXPORTS.findall(text)
    }
    return {"structures": structures, "functions": functions}


def _fields(line: str, lengths: dict[str, int]) -> Iterator[tuple[str, str, list[int]]]:
    """Name, type and lengths of what a declaration without its semicolon declares."""
    plain = " ".join(re.sub(r"\b(const|struct)\b", "", line).split())
    kind, _, names = re.sub(r"\(\*(\w+)\)\(void\)", r"()\1", plain).partition(" ")
    names = re.sub(r"\(\*(\w+)\)\([^()]*\)", r"*\1", names)
    for name in names.split(",") if names else ():
        first, *others = name.replace("]", "").split("[")
        of = "()" if "()" in first and kind == "void" else "*" if {*"()*"} & {*first} else kind
        sizes = [int(size) if size.isdigit() else lengths.get(size, 0) for size in others]
        known = "*" if of in _POINTERS else of if all(sizes) else "?"
        yield first.strip("()* "), known, sizes


def _argument(text: str) -> str:
    """The type of an argument: what is no number is handed over as a pointer."""
    kind = next(word for word in text.split() if word != "const")
    return kind if kind in _NUMBERS and not {*"*["} & {*text} else "*"


# ---- the FMU ----


def fmu_sources() -> list[Path]:
    """The C files of the FMU's library."""
    return sorted(file for file in FMU.glob("src/*/*.c") if file != DESCRIBE)


def _fmu_files() -> list[Path]:
    included = ("src/*/*.h", "src/*/*.def", "include/*.h")
    return [*fmu_sources(), *sorted(path for kind in included for path in FMU.glob(kind))]


def _place(file: Path) -> str:
    """Where a file lies in sources/. The standard's headers lie beside what includes them."""
    folder = "fmi" if file.parent.name == "include" else file.parent.name
    return f"{folder}/{file.name}"


def _make_fmu(target: Path, work: Path) -> None:
    token = _hash([*_fmu_files(), DESCRIBE])[:32]
    flags = (f"-I{FMU / 'include'}", f"-DFMU_TOKEN={token}", *PLAIN_NAMES)
    objects = _objects(fmu_sources(), work, *flags)
    library = work / (MODEL + SUFFIX)
    link(objects, library, "-shared")
    describe = work / ("describe.exe" if sys.platform == "win32" else "describe")
    if CROSS:
        _link_here([*fmu_sources(), DESCRIBE], describe, *flags)
    else:
        link([*objects, *_objects([DESCRIBE], work, *flags)], describe)

    def described(*what: str) -> bytes:
        return _run(str(describe), *what).replace(b"\r\n", b"\n")

    bits = "32" if PROCESSOR == "x86" else "64"
    places = (SYSTEM.removesuffix("dows") + bits, TARGET)
    for version, other, binaries in zip("23", "32", places, strict=True):
        # The library has both interfaces, the sources only the file's own.
        own = [file for file in _fmu_files() if not file.name.startswith(f"fmi{other}")]
        names = [_place(file) for file in own if file.suffix == ".c"]
        contents = {
            "modelDescription.xml": described(version, *names),
            f"binaries/{binaries}/{library.name}": library.read_bytes(),
            "documentation/licenses/license.txt": FMU_LICENSE.read_bytes(),
            **{f"sources/{_place(file)}": file.read_bytes() for file in own},
            "sources/fmi/token.h": f"#define FMU_TOKEN {token}\n".encode(),
            "sources/buildDescription.xml": described("build", version, *names),
        }
        for name, data in contents.items():
            path = target / f"fmi{version}" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)


def _make_thin(target: Path, work: Path) -> None:
    flags = (f"-I{FMU / 'include'}",)
    layer, own = (_objects(_code((folder,), "*.c"), work, *flags) for folder in THIN[::2])
    if SYSTEM != "windows":  # it has threads and a loader of POSIX
        netlist = _objects(_code(THIN[1:2], "*.c"), work, *flags)
        link([*layer, *netlist], target / ("netlist" + SUFFIX), "-shared", *THREADS, *LOADER)
    for source, compiled in zip(_code(THIN[2:], "*.c"), own, strict=True):
        name = source.stem
        folder = target / "models" / name
        library = folder / "binaries" / TARGET / (name + SUFFIX)
        library.parent.mkdir(parents=True)
        made = work / library.name
        link([*layer, compiled], made, "-shared")
        shutil.copyfile(made, library)
        runs_here = library
        if CROSS:
            runs_here = work / f"{name}-here"
            _link_here([*_code(THIN[:1], "*.c"), source], runs_here, *flags, "-fPIC", "-shared")
        why = ctypes.create_string_buffer(512)
        about = str(folder / "modelDescription.xml").encode()
        if not ctypes.CDLL(str(runs_here)).model_describe(3, b"", about, why):
            raise BuildFailed(f"{name}: {why.value.decode()}.")
        licences = folder / "documentation/licenses"
        licences.mkdir(parents=True)
        shutil.copyfile(FMU_LICENSE, licences / "license.txt")


if __name__ == "__main__":
    make(ROOT / "cosim/_compiled")
