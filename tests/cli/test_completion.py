"""What a shell makes of the program that completes the command line."""

import shutil
import subprocess

import pytest

from cosim.cli.main import main

WORDS = {
    "cosim run paper-l": "paper-limited",
    "cosim chart lim": "limits",
    "cosim run paper --lin": "--link",
    "cosim completion z": "zsh",
}


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash")
@pytest.mark.parametrize(("typed", "completed"), WORDS.items())
def test_bash_completes(typed: str, completed: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", "bash"]) == 0
    words = typed.split()
    asked = f'COMP_WORDS=({typed}); COMP_CWORD={len(words) - 1}; _shtab_cosim; echo "$COMPREPLY"'
    script = capsys.readouterr().out + asked
    run = subprocess.run(["bash"], input=script, capture_output=True, text=True, check=True)
    assert run.stdout.split() == [completed]


@pytest.mark.skipif(shutil.which("zsh") is None, reason="there is no zsh")
def test_zsh_reads_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", "zsh"]) == 0
    read = subprocess.run(["zsh", "-n"], input=capsys.readouterr().out, text=True, check=False)
    assert read.returncode == 0
