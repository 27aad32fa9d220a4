"""What a stranger's scene can have done: nothing outside ``--out``."""

from pathlib import Path

import pytest

from cosim.cli.main import main
from cosim.scene import KEYS

pytestmark = [pytest.mark.reliability, pytest.mark.usefixtures("undrawn")]

ODD = [
    "../../planted",
    "/tmp/planted",
    "$(touch planted)",
    "`touch planted`",
    "a\x1b]0;x\x07b",
    "~/x",
]


def everything(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("word", ODD)
def test_a_scene_writes_nothing_outside_its_folder(
    word: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each key that takes a text has the word in turn; and the description, which always may."""
    home, out = tmp_path / "home", tmp_path / "out"
    home.mkdir()
    (home / "precious").write_text("mine")
    monkeypatch.chdir(home)
    quoted = "".join(f"\\u{ord(letter):04x}" for letter in word)
    texts = [key.full for key in KEYS.values() if key.kind is str]
    assert {"circuit.netlist", "drive.file", "friction.normal_force_file"} <= set(texts)
    before = everything(home)
    for name in (None, *texts):
        table, _, key = (name or "run.duration").partition(".")
        value = "0.01" if name is None else f'"{quoted}"'
        scene = tmp_path / "scene.toml"
        scene.write_text(f'description = "{quoted}"\nbase = "held"\n[{table}]\n{key} = {value}\n')
        code = main(["run", str(scene), f"--out={out}"])
        said = capsys.readouterr()
        assert code in (0, 2) and "\x1b" not in said.out + said.err
        assert name is None or code == 2
        assert everything(home) == before
    assert {path.name for path in tmp_path.iterdir()} <= {"home", "out", "scene.toml"}
    assert {path.name for path in out.glob("*")} <= {
        "waveforms.csv", "waveforms.nc", "summary.json", "scene.toml", "figure.png",
    }  # fmt: skip
