"""The FMU's C under the address and undefined-behaviour sanitizers, with a harness in C."""

import os
import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from build_c import FLAGS, FMU, PLAIN_NAMES, compiler, fmu_sources
from tests.helpers.examples import examples

pytestmark = pytest.mark.reliability

SANITIZE = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g1", "-O0"]
HARNESS = Path(__file__).with_name("fmu_harness.c")
LEAK = "#include <stdlib.h>\nint main(void) { char *volatile p = malloc(9); p = 0; return !!p; }\n"


def compile_with_sanitizers(sources: list[Path], program: Path) -> subprocess.CompletedProcess:
    includes = [f"-I{FMU / 'include'}", f"-I{FMU / 'src'}", "-DFMU_TOKEN=harness"]
    command = [*compiler(), *FLAGS, *SANITIZE, *PLAIN_NAMES, *includes, *map(str, sources)]
    return subprocess.run([*command, "-o", str(program), "-lm"], capture_output=True, text=True)


def run(program: Path, leaks: bool, *arguments: str) -> subprocess.CompletedProcess:
    options = f"detect_leaks={int(leaks)}:detect_stack_use_after_return=1"
    environment = os.environ | {"ASAN_OPTIONS": options, "UBSAN_OPTIONS": "print_stacktrace=1"}
    return subprocess.run(
        [str(program), *arguments], capture_output=True, text=True, env=environment
    )


@pytest.fixture(scope="module")
def finds_leaks(tmp_path_factory: pytest.TempPathFactory) -> bool:
    """Whether leaks are found on this machine; skips where the sanitizers are missing."""
    folder = tmp_path_factory.mktemp("probe")
    (folder / "leak.c").write_text(LEAK)
    built = compile_with_sanitizers([folder / "leak.c"], folder / "leak")
    if built.returncode or run(folder / "leak", leaks=False).returncode:
        pytest.skip("this compiler's address and undefined-behaviour sanitizers do not work here")
    return "LeakSanitizer: detected memory leaks" in run(folder / "leak", leaks=True).stderr


@pytest.fixture(scope="module")
def harness(finds_leaks: bool, tmp_path_factory: pytest.TempPathFactory) -> Path:
    program = tmp_path_factory.mktemp("harness") / "harness"
    built = compile_with_sanitizers([*fmu_sources(), HARNESS], program)
    assert built.returncode == 0, built.stderr
    assert "warning" not in built.stderr
    return program


@examples(2, at_least=150)  # 56 million calls in `make fuzz`
@given(seed=st.integers(1, 2**64 - 1))
def test_random_and_senseless_calls(harness: Path, finds_leaks: bool, seed: int) -> None:
    done = run(harness, finds_leaks, str(seed))
    assert done.returncode == 0, done.stderr[-4000:]
    assert int(done.stdout.split()[-2]) >= 372_000
