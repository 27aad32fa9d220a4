"""The file of a normal force that changes in time."""

from pathlib import Path

import pytest

from cosim.errors import BadInput
from cosim.mechanics.normal_force import NormalForce, normal_force
from cosim.scene import changed, load, to_toml


def test_linear_between_corners_and_kept_outside() -> None:
    force = NormalForce([1.0, 2.0, 2.0, 4.0], [3.0, 5.0, 1.0, 2.0])
    for time, newtons in (
        (0.0, 3.0),
        (1.0, 3.0),
        (1.5, 4.0),
        (2.0 - 1e-9, 5.0),
        (2.0, 1.0),
        (2.0 - 1e-13, 1.0),  # the same time within rounding
        (3.0, 1.5),
        (4.0, 2.0),
        (9.0, 2.0),
    ):
        assert force.value(time) == pytest.approx(newtons)


HEADER = "time [s],normal_force [N]\n"


@pytest.mark.parametrize(
    "text, part",
    [
        ("", "this file holds no table"),
        ("time,force\n0,1\n1,1\n", "the header must have the columns"),
        (HEADER, "at least two rows"),
        (HEADER + "0,1\n", "at least two rows"),
        (HEADER + "0,1\n1,-0.5\n", "row 3: the normal force of -0.5 N must be a number from 0"),
        (HEADER + "0,1\n1,2e9\n", "row 3: the normal force of 2e+09 N must be"),
        (HEADER + "0,1\n1,nan\n", "row 3, column normal_force [N]: “nan” is not finite"),
        (HEADER + "0,1\n1\n", "row 3: it has 1 cells, the header 2"),
        (HEADER + "0,1\n1,1\n0.5,1\n", "row 4: the time must not fall"),
    ],
)
def test_a_bad_file_is_told_in_a_sentence(text: str, part: str, tmp_path: Path) -> None:
    path = tmp_path / "grip.csv"
    path.write_text(text, encoding="utf-8")
    scene = load("reference", [f"friction.normal_force_file={path}"])
    with pytest.raises(BadInput, match=r"grip\.csv") as error:
        normal_force(scene)
    assert part in str(error.value)


def test_a_missing_file_is_told() -> None:
    scene = load("reference", ["friction.normal_force_file=no-such.csv"])
    with pytest.raises(BadInput, match=r"no-such\.csv: cannot be read"):
        normal_force(scene)


def test_file_and_number_replace_each_other(tmp_path: Path) -> None:
    (tmp_path / "grip.csv").write_text(HEADER + "0,1\n1,2\n", encoding="utf-8")
    file = tmp_path / "rig.toml"
    file.write_text(
        'base = "reference"\n[friction]\nnormal_force_file = "grip.csv"\n', encoding="utf-8"
    )
    scene = load(str(file))
    assert scene.friction.normal_force_file == str(tmp_path / "grip.csv")
    assert "\n# normal_force = 0.5" in to_toml(scene)
    assert changed(scene, {"friction.normal_force": 0.3}, "x").friction.normal_force_file is None
    assert load(str(file), ["friction.normal_force=0.3"]).friction.normal_force == 0.3
    file.write_text('[friction]\nnormal_force = 1\nnormal_force_file = "grip.csv"\n')
    with pytest.raises(BadInput, match="say the same thing twice"):
        load(str(file))


def test_a_given_surface_has_a_constant_force() -> None:
    with pytest.raises(BadInput, match="moves the part at a constant"):
        load("optimal", ["friction.normal_force_file=grip.csv"])


def test_the_built_in_file_is_found_from_anywhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    force = normal_force(load("closed-loop-grasp"))
    assert force is not None and force.value(1.0) == pytest.approx(0.2)
