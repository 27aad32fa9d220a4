"""The fence alone: what a process behind it cannot do, whatever its code is."""

import errno
import itertools
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from cosim.circuit import ngspice
from cosim.circuit.joined import Deck, Edges
from cosim.coupling.loop import lead
from cosim.errors import SimulationFailed
from cosim.scene import load
from cosim.simulation.elsewhere import bounds
from cosim.toolchain import fence
from cosim.toolchain.libraries import ngspice_library
from cosim.toolchain.processes import isolated
from cosim.toolchain.worker import Bounds

pytestmark = [
    pytest.mark.reliability,
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="a fence of Linux"),
]

SECRET = "a secret of the user's"

ACTS = {
    "write": "open({file!r}, 'w')",
    "append": "open({file!r}, 'a')",
    "truncate": "os.truncate({file!r}, 0)",
    "create": "open({folder!r} + '/new', 'x')",
    "make a folder": "os.mkdir({folder!r} + '/new')",
    "remove": "os.unlink({file!r})",
    "rename": "os.rename({file!r}, 'renamed')",
    "link": "os.link({file!r}, 'linked')",
    "write through a link": "os.symlink({file!r}, 'link') or open('link', 'w')",
    "read": "open({file!r}).read()",
    "list": "os.listdir({folder!r})",
    "change the mode": "os.chmod({file!r}, 0o777)",
    "change the times": "os.utime({file!r})",
    "change the owner": "os.chown({file!r}, 0, 0)",
    "an attribute": "os.setxattr({file!r}, 'user.x', b'x')",
    "a program": "os.execv('/bin/sh', ['sh', '-c', 'touch ' + {folder!r} + '/new'])",
    "a child": "os.fork()",
    "a spawned program": "os.posix_spawn('/bin/sh', ['sh'], {{}})",
    "a socket": "socket.socket()",
    "a socket of files": "socket.socket(socket.AF_UNIX)",
    "a pair of sockets": "socket.socketpair()",
    "a signal to the parent": "os.kill(os.getppid(), 0)",
    "the parent's memory": "open(f'/proc/{{os.getppid()}}/mem', 'rb')",
    "the parent's environment": "open(f'/proc/{{os.getppid()}}/environ', 'rb')",
    "the parent's limits": "resource.prlimit(os.getppid(), resource.RLIMIT_CPU, (1, 1))",
    "the parent's priority": "os.setpriority(os.PRIO_PROCESS, os.getppid(), 19)",
    "the parent's processors": "os.sched_setaffinity(os.getppid(), {{0}})",
    "the parent's scheduler": "os.sched_setscheduler(os.getppid(), 0, os.sched_param(0))",
    "a device": "open('/dev/zero', 'rb')",
    "passwords": "open('/etc/shadow', 'rb')",
}

MAY = {
    "its own folder": "open('own', 'w').write('x')",
    "its own limits": "resource.setrlimit(resource.RLIMIT_CORE, (0, 0))",
    "a thread": "threading.Thread(target=int).start()",
    "its libraries": "open(os.__file__).read(1)",
    "what it was given": "open({given!r}).read()",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    above = tmp_path_factory.mktemp("fence")
    (above / "users").mkdir()
    (above / "users" / "file").write_text(SECRET, encoding="utf-8")
    (above / "given").write_text("given", encoding="utf-8")
    return above / "users"


def _acts(code: str, progress: object) -> tuple[str, ...] | int:
    import resource  # noqa: F401 (the code may use it)
    import socket  # noqa: F401 (the code may use it)
    import threading  # noqa: F401

    if fence.lacking:
        return fence.lacking
    try:
        eval(code)
    except OSError as error:
        return error.errno or 0
    return 0


@pytest.mark.parametrize("act", [*ACTS, *MAY])
def test_what_a_process_behind_the_fence_can_do(act: str, folder: Path) -> None:
    given = folder.parent / "given"
    places = {"file": str(folder / "file"), "folder": str(folder), "given": str(given)}
    code = (ACTS | MAY)[act].format(**places)
    found = isolated(_acts, code, lambda _: None, Bounds((str(given),)))
    if isinstance(found, list):
        pytest.skip(f"this system has no {' and no '.join(found)}")
    assert found in ((0,) if act in MAY else (errno.EACCES, errno.EPERM, errno.EXDEV))
    assert (folder / "file").read_text(encoding="utf-8") == SECRET
    assert [path.name for path in folder.iterdir()] == ["file"]


def test_of_a_netlists_folder_only_what_it_includes_is_read(tmp_path: Path) -> None:
    (tmp_path / "above.inc").write_text("R1 a b 1\n")
    home = tmp_path / "home"
    (home / "parts").mkdir(parents=True)
    files = {
        "own.cir": "title\n.include\n+ parts/coil.inc\n.inc ../above.inc\n.inc link.inc\n.end\n",
        "parts/coil.inc": "  .LIB 'a part.lib' fast\n",
        "parts/a part.lib": ".lib fast\nR1 a b 1\n.endl\n",
        "letter.txt": SECRET,
    }
    for name, text in files.items():
        (home / name).write_text(text, encoding="utf-8")
    (home / "link.inc").symlink_to(tmp_path / "above.inc")
    scene = load("paper", {"circuit.model": "file", "circuit.netlist": str(home / "own.cir")})

    def opened(path: Path) -> object:
        return isolated(_acts, f"open({str(path)!r}).read()", lambda _: None, bounds(scene))

    if isinstance(lacking := opened(home / "own.cir"), list):
        pytest.skip(f"this system has no {' and no '.join(lacking)}")
    assert [opened(home / name) for name in files] == [0, 0, 0, errno.EACCES]
    assert opened(home / "link.inc") == opened(tmp_path / "above.inc") == errno.EACCES


def commands(file: Path, new: Path) -> Iterator[str]:
    """Commands of ngspice that write, read or run."""
    for place in (file, new):
        for write in (
            "write {}", "wrdata {} v(a)", "print v(a) > {}", "echo x > {}", "echo x >> {}",
            "snsave {}", "wrs2p {}", "show all > {}", "listing > {}", "rusage all > {}",
            "display > {}", "asciiplot v(a) > {}", "hardcopy {} v(a)", "gnuplot {} v(a)",
            "wrnodev {}", "inventory > {}", "history > {}", "devhelp > {}", "version > {}",
            "status > {}", "setplot > {}", "write {} v(a)", "alias x write {}\nx",
            "shell touch {}", "shell echo x > {}", "edit {}",
        ):  # fmt: skip
            yield write.format(place)
    for read in ("source {}", "load {}", "codemodel {}", "osdi {}", "snload {} {}", "cd {}"):
        yield read.format(file, file)
    yield f"set rawfile={new}\nwrite"
    yield f"set sourcepath = ( {file.parent} )\nsource {file.name}"


def wrapped(command: str) -> Iterator[str]:
    """Decks with a command where ngspice runs one."""
    circuit = "Vcommand a 0 1\nR1 a 0 1k\n.tran 1u 10u"
    comment = "\n".join(f"*# {line}" for line in command.split("\n"))
    yield f"title\n{circuit}\n.control\nrun\n{command}\n.endc\n.end"
    yield f"title\n.control\nop\n{command}\n.endc\n{circuit}\n.end"
    yield f"title\n.CONTROL\npre_{command}\n{command}\n.ENDC\n{circuit}\n.end"
    yield f"title\n*# run\n{comment}\n{circuit}\n.end"
    yield f"*ng_script\n{command}\n.end"


TRAN = ".tran 1u 10u\n.end"
GLUED = ("level={}", "vto=1level={}", "LEVEL = {}", "vto=1 level={}", "(level={})", "level={}.0")


def models(file: Path, new: Path) -> Iterator[str]:
    """Decks whose devices write files, or read them."""
    for level, form in itertools.product((4, 8, 10, 14, 49, 54, 57, 58), GLUED):
        for kind in ("nmos", "pmos"):
            yield (
                f"title\nVcommand a 0 1\nM1 a a 0 0 m l=1u w=1u\n"
                f".model m {kind} {form.format(level)}\n.tran 1u 10u\n.end"
            )
    for place in (file, new):
        for model in (
            "d_process(process_file=\"{}\")", "d_source(input_file=\"{}\")",
            "filesource(file=\"{}\")", "d_state(state_file=\"{}\")", "table2d(file=\"{}\")",
        ):  # fmt: skip
            text = model.format(place)
            yield f"title\nVcommand a 0 1\nA1 [a] [b] m\nR1 b 0 1\n.model m {text}\n{TRAN}"
    for line in (".include {}", '.include "{}"', ".inc {}", ".lib {} part", ".INCLUDE '{}'"):
        yield f"title\nVcommand a 0 1\nR1 a 0 1k\n{line.format(file)}\n{TRAN}"
    for line in (
        ".print tran v(a) > {}",
        ".probe file={}",
        ".save all > {}",
        ".options rawfile={}",
    ):
        yield f"title\nVcommand a 0 1\nR1 a 0 1k\n{line.format(new)}\n{TRAN}"


def decks(folder: Path) -> list[str]:
    places = folder / "file", folder / "new"
    found = [deck for command in commands(*places) for deck in wrapped(command)]
    return [*found, *models(*places)]


class _Nobody(ngspice.Leader):
    def __init__(self) -> None:
        self.places = [0, 0]

    def begin(self) -> None: ...

    def finish(self) -> None: ...

    def stop(self) -> None: ...


def _load() -> None:
    lead.engine()


def _raw(deck: str, progress: object) -> str:
    """What ngspice says of a deck that nobody has looked at."""
    engine = lead.engine()
    engine.transient(Deck(deck, {"v(a)": "v(a)"}, Edges((), 0.0)), _Nobody())
    return "\n".join((*engine._stdout, *engine._stderr))


def harmed(deck: str, folder: Path, bounds: Bounds | None) -> bool:
    """Whether ngspice does something to the user's folder, or tells what stands there."""
    try:
        said = isolated(_raw, deck, lambda _: None, bounds)
    except SimulationFailed:
        said = ""  # it has ended its process
    file, new = folder / "file", [path for path in folder.iterdir() if path.name != "file"]
    whole = file.exists() and file.read_text(encoding="utf-8", errors="replace") == SECRET
    for path in new:
        path.unlink()
    file.write_text(SECRET, encoding="utf-8")
    return bool(new) or not whole or SECRET.lower() in said.lower()


def _parts(some: bool) -> object:
    return pytest.param(some, marks=[] if some else [pytest.mark.slow, pytest.mark.timeout(1800)])


@pytest.mark.parametrize("some", [_parts(True), _parts(False)], ids=["some", "all"])
def test_netlists_that_nobody_has_checked(some: bool, folder: Path) -> None:
    """Those that would do harm do none: without the reader, behind the fence alone."""
    bounds = Bounds(library=ngspice_library(), first=_load)
    if isinstance(lacking := isolated(_acts, "0", lambda _: None, Bounds()), list):
        pytest.skip(f"this system has no {' and no '.join(lacking)}")
    every = decks(folder)
    assert len(every) >= 400
    chosen = every[:: 37 if some else 1]
    assert not [deck for deck in chosen if harmed(deck, folder, bounds)]
    # Without the fence some of them do: else nothing is shown.
    assert any(harmed(deck, folder, None) for deck in chosen[::3])
    assert os.listdir(folder) == ["file"]
