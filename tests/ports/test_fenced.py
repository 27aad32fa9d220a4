"""A stranger's FMU is machine code; what it may do is what the fence lets its process do."""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import cosim
from cosim.errors import CosimError
from tests.ports.foreign import build
from tests.ports.test_coupled import motor

pytestmark = [
    pytest.mark.reliability,
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="a fence of Linux"),
]

ACTS = r"""
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <unistd.h>

static int worked;

static void has_worked(const char *what)
{
    fprintf(stderr, "WORKED: %s\n", what);
    worked = 1;
}

/* Runs as the library is loaded, before anybody asks the FMU for anything. What has worked is a
   line on stderr, and the end of the process. */
__attribute__((constructor)) static void act(void)
{
    const char *user = "@FOLDER@";
    char name[4096];
    snprintf(name, sizeof name, "%s/left-behind", user);
    if (open(name, O_CREAT | O_WRONLY, 0644) >= 0)
        has_worked("write");
    snprintf(name, sizeof name, "%s/secret", user);
    if (open(name, O_RDONLY) >= 0)
        has_worked("read");
    if (unlink(name) == 0)
        has_worked("remove");
    snprintf(name, sizeof name, "touch %s/left-behind", user);
    if (system(name) == 0)
        has_worked("program");
    if (socket(AF_INET, SOCK_STREAM, 0) >= 0)
        has_worked("socket");
    if (worked)
        abort();
}
"""


SPEAKS = r"""
#include <arpa/inet.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* Speaks in the place of its process to whoever listens. */
__attribute__((constructor)) static void act(void)
{
    const char said[] = "@WORDS@";
    unsigned length = htonl(sizeof said - 1);
    struct stat about;
    for (int handle = 3; handle < 256; handle++)
        if (!fstat(handle, &about) && S_ISSOCK(about.st_mode)) {
            write(handle, &length, sizeof length);
            write(handle, said, sizeof said - 1);
        }
}
"""

CRASH = "#include <stdlib.h>\n__attribute__((constructor)) static void act(void) { abort(); }\n"


def scene_with(folder: Path, acts: str) -> Path:
    """A scene whose FMU does this as it is loaded, and else works as the good one does."""
    scene = motor(folder)
    source, library = folder / "evil.c", next(folder.glob("foreign.*"))
    source.write_text(acts + Path(__file__).with_name("foreign.c").read_text())
    library.unlink()  # loaded by nobody, but a linker may write into what is there
    subprocess.run(["cc", "-shared", "-fPIC", "-w", "-o", library, source, "-lm"], check=True)
    build(folder, "Rotor")
    return scene


@pytest.fixture
def user(tmp_path: Path) -> Path:
    """A folder of the user's."""
    folder = tmp_path / "user"
    folder.mkdir()
    (folder / "secret").write_text("mine")
    return folder


@pytest.fixture
def evil(tmp_path: Path, user: Path) -> Path:
    folder = tmp_path / "scene"
    folder.mkdir()
    return scene_with(folder, ACTS.replace("@FOLDER@", str(user)))


def test_it_writes_reads_starts_and_connects_nothing(evil: Path, user: Path) -> None:
    result = cosim.run(evil, {"run.duration": 1e-3})
    assert result.columns["rotor.omega"].size > 1  # it was loaded and has run
    assert [path.name for path in user.iterdir()] == ["secret"]
    assert (user / "secret").read_text() == "mine"


def test_without_the_fence_the_same_acts_work(evil: Path, tmp_path: Path) -> None:
    """So what the test above sees is the fence."""
    with zipfile.ZipFile(evil.with_name("Rotor.fmu")) as archive:
        (name,) = [each for each in archive.namelist() if each.startswith("binaries/")]
        archive.extract(name, tmp_path)
    program = f"import ctypes; ctypes.CDLL({str(tmp_path / name)!r})"
    said = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True).stderr
    assert sorted(said.split("WORKED: ")[1:]) == [
        *("program\n", "read\n", "remove\n", "socket\n", "write\n")
    ]


@pytest.mark.parametrize(
    "words",
    [
        "cposix\\nsystem\\n(S'touch @FOLDER@/left-behind'\\ntR.",
        '[\\"result\\",[{\\"__columns__\\":[\\"@FOLDER@/secret\\",[],0]},{},{}]]',
        '[\\"result\\",[{\\"__columns__\\":[\\"..\\",[],0]},{},{}]]',
        "[" * 5000,
    ],
    ids=["a pickle", "columns elsewhere", "a folder of columns", "depth"],
)
def test_what_it_says_in_place_of_its_process_does_nothing(
    tmp_path: Path, user: Path, words: str
) -> None:
    folder = tmp_path / "scene"
    folder.mkdir()
    said = words.replace("@FOLDER@", str(user))
    scene = scene_with(folder, SPEAKS.replace("@WORDS@", said))
    with pytest.raises(CosimError, match="process"):
        cosim.run(scene, {"run.duration": 1e-3})
    assert [path.name for path in user.iterdir()] == ["secret"]
    assert (user / "secret").read_text() == "mine"


def test_a_crash_while_it_is_loaded_is_told(tmp_path: Path) -> None:
    scene = scene_with(tmp_path, CRASH)
    with pytest.raises(CosimError) as told:
        cosim.run(scene, {"run.duration": 1e-3})
    assert "\n" not in str(told.value) and "FMUs (rotor)" in str(told.value)
