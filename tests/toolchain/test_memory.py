"""Too little memory is told before a library that finds too little ends the process."""

import resource
import subprocess
import sys
from pathlib import Path

import pytest

import build_c
from cosim.errors import SimulationFailed
from cosim.toolchain import memory

pytestmark = [
    pytest.mark.reliability,
    pytest.mark.skipif(sys.platform != "linux", reason="only Linux keeps to a limit of memory"),
]

GROUPS = {
    "of version 2": ("0::/a/b", "a/b/memory.max"),
    "above it": ("0::/a/b", "memory.max"),
    "of version 1": ("4:memory:/a\n0::/", "memory/a/memory.limit_in_bytes"),
    "of a container, which sees its own as the top": (
        "4:memory:/far/away",
        "memory/memory.limit_in_bytes",
    ),
}


@pytest.mark.parametrize("command", ["run", "fmu", "export", "theory", "sweep"])
@pytest.mark.parametrize("megabytes", [60, 80, 100])
def test_limit_of_addresses(command: str, megabytes: int, tmp_path: Path) -> None:
    limit = megabytes << 20
    words = {"run": ["held"], "fmu": ["check"], "sweep": ["held"], "theory": []}.get(command)
    words = [str(tmp_path), "--as=csv"] if words is None else words
    done = subprocess.run(
        [sys.executable, "-m", "cosim", command, *words],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)),
        capture_output=True,
        text=True,
        cwd=build_c.ROOT,
        check=False,
    )
    assert done.returncode == 3, done.stderr
    told = done.stderr.splitlines()
    assert len(told) == 1 and told[0].startswith("cosim: This process may have ")
    assert f"(ulimit -v); cosim {command} needs at least" in told[0]


@pytest.mark.parametrize(("line", "file"), GROUPS.values(), ids=GROUPS)
def test_limit_of_a_control_group(line: str, file: str, tmp_path: Path) -> None:
    (tmp_path / "proc/self").mkdir(parents=True)
    (tmp_path / "proc/self/cgroup").write_text(f"5:devices:/\n{line}\n")
    path = tmp_path / "sys/fs/cgroup" / file
    path.parent.mkdir(parents=True)
    for enough in ("max\n", f"{81 * 10**6}\n"):
        path.write_text(enough)
        memory.check("run", tmp_path)
    path.write_text(f"{79 * 10**6}\n")
    with pytest.raises(SimulationFailed, match=r"79 MB of memory \(cgroup\)"):
        memory.check("run", tmp_path)
    memory.check("scenes", tmp_path)
