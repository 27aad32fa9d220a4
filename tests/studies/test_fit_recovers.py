"""Fits of the bench's own exported runs, whose parameters are known, and the files of forces."""

import warnings
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

import cosim
from cosim.cli.main import main
from cosim.errors import BadInput, BeyondModel
from cosim.files.atomic import write_text
from cosim.mechanics import part
from cosim.scene.model import to_toml
from cosim.studies.fit.fit import TrialResults
from cosim.studies.fit.forces import Force, read_forces
from cosim.waveforms.formats import tracker
from cosim.waveforms.formats.source import Run

pytestmark = pytest.mark.physics

WEIGHT = 0.009 * 9.81  # N, of the part
MU_K, MU_S = 0.59, 0.72
# Hz, V, V and N; the names are such as the published trials have, whose forces are others.
RUNS = {
    "Trial #1": (10, 8.0, -1.2, 0.5),
    "Trial #2": (20, 8.0, -1.2, 0.5),
    "Trial #3": (30, 7.0, -0.6, 0.4),
    "Trial #4": (50, 9.0, -1.2, 0.6),
    "Trial #5": (20, 6.0, -0.5, 0.3),
    "Trial #6": (10, 10.0, 1.0, 0.8),
    "Trial #7": (40, 9.0, 0.5, 0.9),
    "Trial #8": (20, 9.5, -1.5, 1.2),
    "Trial #9": (15, 7.0, -2.0, 1.6),
}
TRUTH = {name: force / WEIGHT for name, (*_, force) in RUNS.items()}


def export(folder: Path, name: str, **friction: float) -> None:
    """A run as a tracked trial; without the run's figure and tables, which take longer than it."""
    frequency, amplitude, offset, force = RUNS[name]
    friction = {"mu_k": MU_K, "mu_s": MU_S, "normal_force": force} | friction
    scene = {
        "circuit.model": "limited",
        "drive.frequency": frequency,
        "drive.amplitude": amplitude,
        "drive.offset": offset,
        "run.settle": 0.0,
        "run.duration": 0.25,
        **{f"friction.{key}": value for key, value in friction.items()},
    }
    with warnings.catch_warnings():  # some coils grow hot
        warnings.simplefilter("ignore", BeyondModel)
        result = cosim.run("reference", scene)
    home = folder / "runs" / name
    write_text(home / "scene.toml", to_toml(result.scene))
    file = BytesIO()
    tracker.write(Run(home, result.columns, {}, {}, datetime.now(UTC)), file)
    (folder / f"{name}.csv").write_bytes(file.getvalue())


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("exported")
    for name in RUNS:
        export(folder, name)
    return folder


@pytest.fixture(scope="module")
def recovered(exported: Path) -> TrialResults:
    return cosim.fit(exported)


def test_nine_exported_runs_give_their_parameters_back(recovered: TrialResults) -> None:
    """On these runs a fit of paths on tracked velocities finds µ_k 0.40 and forces 0.5 to 2.7 times
    the true ones."""
    found = recovered.numbers
    assert found["between_frames"] == "impacts"
    assert found["mu_k"] == pytest.approx(MU_K, abs=0.02)
    low, high = found["mu_k_95_percent"]
    assert low <= MU_K <= high
    assert found["mass_ratio"] == pytest.approx(9 / 14.5, abs=0.05)
    assert [row["trial"] for row in found["trials"]] == list(TRUTH)
    for row in found["trials"]:
        truth = TRUTH[row["trial"]]
        assert row["normal_force_weights"] == pytest.approx(truth, rel=0.1)
        low, high = row["normal_force_95_percent"]
        assert low <= truth <= high
        assert row["normal_force_determined"] == "yes"


def test_runs_on_which_the_part_never_slips_bound_its_force_from_below(
    exported: Path, tmp_path: Path
):
    export(tmp_path, "Trial #9", normal_force=5.0)
    (row,) = cosim.fit(tmp_path).numbers["trials"]
    assert row["normal_force_determined"] in ("at least", "no")
    low, high = row["normal_force_95_percent"]
    assert low <= 5.0 / WEIGHT <= high


def test_the_plates_friction_is_recovered_beside_the_surfaces(tmp_path: Path) -> None:
    for name in ("Trial #2", "Trial #4", "Trial #5"):
        export(tmp_path, name, mu_k=0.55, mu_plate=0.15)
    found = cosim.fit(tmp_path, plate=True).numbers
    assert found["mu_plate"] == pytest.approx(0.15, abs=0.02)
    low, high = found["mu_plate_95_percent"]
    assert low <= 0.15 <= high
    low, high = found["mu_k_95_percent"]
    assert low <= 0.55 <= high


def test_static_friction_follows_from_known_forces(exported: Path, tmp_path: Path) -> None:
    """Bounds in newtons, with the mass of the part, 6 % on either side."""
    names = ("Trial #2", "Trial #4", "Trial #5")
    lines = ["trial,force,lower,upper,mass"]
    for name in names:
        (tmp_path / f"{name}.csv").write_bytes((exported / f"{name}.csv").read_bytes())
        force = RUNS[name][-1]
        lines.append(f"{name},{force},{0.94 * force},{1.06 * force},0.009")
    (tmp_path / "forces.csv").write_text("\n".join(lines), encoding="utf-8")
    found = cosim.fit(tmp_path, forces=tmp_path / "forces.csv", mu_s="free").numbers
    assert found["mu_s"] == pytest.approx(MU_S, rel=0.06)
    low, high = found["mu_s_95_percent"]
    assert low <= MU_S <= high
    assert [row["normal_force_measured_weights"] for row in found["trials"]] == [
        pytest.approx(TRUTH[name]) for name in names
    ]


@pytest.mark.parametrize("pull_up", [0.0, 3.0])
def test_heights_seen_from_a_plate_that_moves(pull_up: float) -> None:
    """A part without friction at the surface: what pulls it is the plate, which rises with
    ``pull_up`` m/s². Where µ_p F_n/m exceeds g + pull_up it rides on the plate; else it slides
    against it with g − µ_p F_n/m."""
    time, output = np.linspace(0.0, 0.1, 11), np.linspace(0.0, 0.1, 7)
    v_plate = pull_up * time
    plate = pull_up * output**2 / 2
    for friction, expected in ((15.0, plate), (4.0, -(9.81 - 4.0) * output**2 / 2)):
        law = np.array([[0.0, 0.0, friction, 9.81]])
        pull = np.full(10, pull_up)
        found = part.heights(time, -v_plate, law, output, 0.0, pull)[0] + plate
        np.testing.assert_allclose(found, expected, atol=1e-15)


def test_heights_without_the_plates_friction_do_not_depend_on_the_plate() -> None:
    generator = np.random.default_rng(0)
    time = np.linspace(0.0, 0.2, 41)
    v, v_plate = generator.normal(0.0, 0.1, (2, len(time)))
    laws = np.array([[60.0, 50.0, 0.0, 9.81], [25.0, 15.0, 0.0, 9.81]])
    plate = cumulative_trapezoid(v_plate, time, initial=0.0)
    pull = np.diff(v_plate) / np.diff(time)
    v0 = float(v[0])
    seen = part.heights(time, v - v_plate, laws, time, v0 - float(v_plate[0]), pull)
    np.testing.assert_allclose(seen + plate, part.heights(time, v, laws, time, v0), atol=1e-12)
    for law, z in zip(laws, part.heights(time, v, laws, time, v0), strict=True):
        one = {"mu_s": law[0] / 10, "mu_k": law[1] / 10, "force_per_mass": 10.0}
        np.testing.assert_allclose(z, part.exact(time, v, v0=v0, **one).z, atol=1e-15)


FORCES = {
    "csv": "\ufefftrial,force,lower,upper,mass\n a ,0.5,0.4,,0.01\n\nb,,,12,\n",
    "toml": "[a]\nforce = 0.5\nlower = 0.4\nmass = 0.01\n[b]\nupper = 12",
}


@pytest.mark.parametrize("ending", FORCES)
def test_forces_from_a_file(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"known.{ending}"
    path.write_text(FORCES[ending].replace(" a ", "a"), encoding="utf-8")
    found = read_forces(path, ["a", "b", "c"])
    assert found["a"].measured == pytest.approx(0.5 / 0.01 / 9.81)
    assert found["a"].lower == pytest.approx(0.4 / 0.01 / 9.81)
    assert (found["a"].upper, found["b"]) == (None, Force(upper=12.0))


@pytest.mark.parametrize(
    ("name", "text", "told"),
    [
        ("f.csv", "name,force\na,1\n", "f.csv: row 1: the column “trial” is missing"),
        ("f.csv", "trial,force\na,-1\n", "f.csv: row 2: force must be above 0 and at most 1e+06, "),
        ("f.csv", "trial,force\na,much\n", "not “much”"),
        ("f.csv", "trial,force\na,1,2\n", "row 2: it has 3 cells, the header 2"),
        ("f.csv", "trial,weight\na,1\n", "“weight” is none of force, lower, upper, mass"),
        ("f.csv", "trial,force\na,1\na,2\n", "row 3: the trial “a” stands there twice"),
        ("f.csv", "trial,force\nz,1\n", "there is no trial “z” (there are: a)"),
        ("f.csv", "trial,lower,upper\na,3,2\n", "lower must not be above upper, and is 3"),
        ("f.csv", "trial,force\n", "holds no forces"),
        ("f.toml", "a = 1", "“a” must be the table of a trial"),
        ("f.toml", "[a", "this is not TOML"),
    ],
)
def test_what_is_wrong_with_a_file_of_forces(
    name: str, text: str, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One sentence, before anything is fitted, and nothing written."""
    rows = [f"{i / 960},{i},{i}" for i in range(12)]
    (tmp_path / "a.csv").write_text("\n".join(["t,zp,zo", *rows]), encoding="utf-8")
    (tmp_path / name).write_text(text, encoding="utf-8")
    out = tmp_path / "out"
    arguments = ["fit", str(tmp_path), "--forces", str(tmp_path / name), "--out", str(out)]
    assert main(arguments) == 2
    said = capsys.readouterr().err
    assert told in said and said.count("\n") == 1 and "Traceback" not in said
    assert not out.exists()


def test_mu_s_needs_bounds_to_be_fitted(tmp_path: Path) -> None:
    rows = [f"{i / 960},{i},{i}" for i in range(12)]
    (tmp_path / "a.csv").write_text("\n".join(["t,zp,zo", *rows]), encoding="utf-8")
    with pytest.raises(BadInput, match="bounds of normal forces are known"):
        cosim.fit(tmp_path, mu_s="free")
    with pytest.raises(BadInput, match="mass_ratio must lie between 0 and 10"):
        cosim.fit(tmp_path, mass_ratio=-1.0)
    with pytest.raises(BadInput, match="mu_s must be above 0"):
        cosim.fit(tmp_path, mu_s=0.0)
    with pytest.raises(BadInput, match="scheme needs"):
        cosim.fit(tmp_path, solver="published")
