"""What is achievable: against closed forms, a grid, an independent solver, and itself."""

import csv
import json
import shlex
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.linalg import expm

import cosim
from cosim.arrays import Array
from cosim.cli.main import main
from cosim.errors import BadInput
from cosim.evaluate.point import Outcome
from cosim.evaluate.store import Store
from cosim.files.picture import Picture
from cosim.scene import changed, load
from cosim.simulation.fidelity import Fidelity
from cosim.simulation.simulate import simulate
from cosim.studies.limits import aims, confirm, report, runs, study
from cosim.studies.limits.aims import QUANTITIES
from cosim.studies.limits.answer import BINDS, NOTHING, UNTOLD, Change
from cosim.studies.limits.report import STORE
from cosim.studies.limits.runs import Bench, Case
from cosim.studies.limits.search import Effort, Frontiers, Leads
from cosim.studies.limits.table import LIMITS, Machine, needed_acceleration
from tests.studies.test_figures import assert_legible

BY_NAME = {limit.name: limit for limit in LIMITS}
NUMBER = {quantity.name: number for number, quantity in enumerate(QUANTITIES)}


@pytest.fixture
def brief(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Short runs."""
    monkeypatch.setattr(runs, "SETTLE", 0.05)
    monkeypatch.setattr(runs, "SPAN", 0.1)
    yield


def bench(folder: Path, scene: Any = "reference", **more: Any) -> Bench:
    return Bench(load(scene), str(scene), folder / STORE, 2, **more)


def test_back_emf_is_turned_alone() -> None:
    """Within the limits: the same motion, and a voltage less by what is gone of the back-EMF."""
    base = load(
        "reference",
        [
            *("run.duration=0.2", "run.settle=0.1", "circuit.model=limited"),
            *("drive.waveform=sine", "circuit.supply=100", "coil.count=2"),
            "mechanics.tolerance=1e-10",
        ],
    )
    machine = BY_NAME["back-EMF"].machine(base, 0.25)
    own, less = simulate(base), simulate(changed(base, machine.settings, "test"))
    np.testing.assert_allclose(less.columns["z_ram"], own.columns["z_ram"], rtol=0, atol=1e-12)
    gone = own.columns["coil_voltage"] - less.columns["coil_voltage"]
    np.testing.assert_allclose(gone, 0.75 * own.columns["back_emf"], rtol=0, atol=1e-8)
    # The coil that it stands for carries the same current and makes the same heat.
    current = less.columns["current"] * machine.coil_scale
    np.testing.assert_allclose(current, own.columns["current"], rtol=1e-9, atol=1e-12)
    heat = less.summary["energy_copper"] * machine.coil_scale
    assert heat == pytest.approx(own.summary["energy_copper"], rel=1e-6)


def test_every_setting_of_the_knobs_can_be_quantised() -> None:
    """Volts with six digits put no knob that is at its end outside what the DAC gives."""
    base = changed(load("reference"), aims.FREE, "test")
    for step in range(aims.STEPS + 1):
        for end in (0.0, 1.0):
            volts = aims.settings(np.array([step / aims.STEPS, 0.5, end]))
            assert changed(base, {**volts, "drive.quantised": True}, "test").drive.quantised


def test_sense_resistor_leaves_the_current(tmp_path: Path) -> None:
    point = np.array([0.6, 0.8, 0.2])
    with bench(tmp_path) as made:
        machines = Machine(), BY_NAME["sense resistor"].machine(made.scene, 0.1)
        every = [Case({}, machine, "ideal").settings(point) for machine in machines]
        own, less = made.outcomes(every)
    for name in ("v_average", "current_max"):
        assert less.numbers[name] == pytest.approx(own.numbers[name], rel=1e-5)


def test_needed_acceleration() -> None:
    """0.72 x 0.5 N / 9 g + g; two surfaces of a gripper hold twice."""
    assert needed_acceleration(load("reference")) == pytest.approx(49.81)
    both = load("reference", ["mechanics.n_surfaces=2"])
    assert needed_acceleration(both) == pytest.approx(89.81)


def test_the_cube_is_what_the_potentiometers_set() -> None:
    """Each is read in 1024 steps, 0 to 1023."""
    for steps in ([0, 0, 0], [1023, 1023, 1023], [307, 716, 921]):
        pots = dict(zip(("pot_max", "pot_frequency", "pot_offset"), steps, strict=True))
        drive = load("reference", {f"drive.{name}": n / 1024 for name, n in pots.items()}).drive
        for key, value in aims.settings(np.array(steps) / 1023).items():
            assert value == pytest.approx(getattr(drive, key.split(".")[1]), abs=1e-6)


LINEAR = {
    "mechanics.travel": 10.0, "mechanics.suspension_k1": 200.0, "mechanics.suspension_k3": 0.0,
    "mechanics.suspension_damping": 0.3, "mechanics.flexure_damping": 3.0,
    "friction.normal_force": 100.0,
}  # fmt: skip


def test_ideal_current_without_walls_is_the_linear_surface(tmp_path: Path) -> None:
    """Two masses on springs under a sawtooth, by matrix exponentials; the part sticks."""
    point = np.array([0.4, 0.5, 0.3])
    with bench(tmp_path) as made:
        case = Case(dict(LINEAR), Machine(), "ideal")
        there = case.settings(point)
        found, _ = made.scores(case, point[None])
        scene = changed(made.scene, there, "test")
    mechanics, drive, period = scene.mechanics, scene.drive, 1.0 / scene.drive.frequency
    ram, body = mechanics.ram_mass, mechanics.surface_mass + mechanics.part_mass
    force = scene.coil.force_factor / scene.circuit.sense_resistance
    k, c = mechanics.suspension_k1, mechanics.suspension_damping
    spring, damper = mechanics.flexure_stiffness, mechanics.flexure_damping
    # z_s, v_s, z_r, v_r about their equilibrium, and the command with its slope
    a = np.zeros((6, 6))
    a[0, 1] = a[2, 3] = a[4, 5] = 1.0
    a[1] = np.array([-k - spring, -c - damper, k, c, -force, 0.0]) / body
    a[3] = np.array([k, c, -k, -c, force, 0.0]) / ram
    count = 2000
    step = expm(a * period / count)
    state, falls = np.zeros(6), []
    for cycle in range(round(scene.run.duration / period)):
        state[4:] = drive.offset - drive.amplitude / 2.0, drive.amplitude / period
        for _ in range(count):
            if cycle * period >= scene.run.settle - 1e-9:
                falls.append(-a[1] @ state)
            state = step @ state
    assert found[0, NUMBER["a_free"]] == pytest.approx(max(falls), rel=1e-4)
    assert found[0, NUMBER["a_free"]] == found[0, NUMBER["a_walls"]]


def test_a_ram_at_a_wall_is_told(tmp_path: Path) -> None:
    """One that rests there makes no impacts either, and its surface hardly moves."""
    with bench(tmp_path) as made:
        found, _ = made.scores(Case({}, Machine()), np.array([[0.0, 0.8, 0.9], [0.9, 0.8, 0.4]]))
    assert (found[:, NUMBER["a_free"]] < 0.0).all()


@pytest.mark.slow
@pytest.mark.usefixtures("brief")
def test_search_finds_what_an_exhaustive_grid_finds(tmp_path: Path) -> None:
    grid = np.stack(np.meshgrid(*[np.linspace(0.04, 0.96, 7)] * 3), axis=-1).reshape(-1, 3)
    case = Case({}, Machine())
    with bench(tmp_path) as made:
        scores, feasible = made.scores(case, np.round(grid * aims.STEPS) / aims.STEPS)
        one = Frontiers(lambda points: made.scores(case, points), (0,))
        searched(one, 256)
        best = np.where(feasible[:, None], scores, -np.inf).max(axis=0)
        found = one.bests()
        again = Frontiers(lambda points: made.scores(case, points), (0,))
        searched(again, 256)
        assert again.bests() == found
        for number, top in enumerate(found):
            if best[number] > 0.0:
                assert top.settings[0].value >= 0.95 * best[number], QUANTITIES[number].name
        steady = found[NUMBER["v_up"]].robust[0]
        assert 0.0 < steady.worst <= steady.median <= found[NUMBER["v_up"]].settings[0].value
        every = [case.settings(np.array(top.settings[0].point)) for top in found[3:]]
        for settings, outcome in zip(every, made.outcomes(every), strict=True):
            assert made.heat(case, settings, outcome.numbers) <= case.machine.heat
        independent(case.settings(np.array(steady.point)), steady.value)


def searched(one: Frontiers, design: int = 1024) -> None:
    """With the effort of a study, but for the points that fill the cube."""
    own = study.FULL.own
    one.fill(design)
    one.climb(study.FIRST, own.first)
    for _ in range(own.rounds):
        one.climb(study.LATER, own.later)


def independent(settings: dict[str, Any], v_average: float) -> None:
    """A found point by the monolithic reference."""
    monolithic = pytest.importorskip("tests.reference.monolithic")
    values = {key.split(".")[1]: value for key, value in settings.items()}
    duration, settle = values.pop("duration"), values.pop("settle")
    found = monolithic.simulate(
        values, duration, settle, contact="compliant", circuit=values.pop("model")
    )
    assert v_average == pytest.approx(found.v_average, rel=2e-3)


def ridge(points: Array) -> tuple[Array, Any]:
    """A narrow ridge aslant to the knobs with ripples, and a second one that is forbidden."""
    x, y, z = (points - 0.5).T
    along, across, up = x + y, x - y, z - 0.3 * x
    first = np.exp(-((across / 0.05) ** 2) - (along / 0.5) ** 2 - (up / 0.1) ** 2)
    first *= 1.0 + 0.05 * np.cos(80.0 * along)
    second = np.exp(-((points - 0.3) ** 2).sum(axis=1) / 0.02)
    return np.stack([first, second], axis=1), points[:, 0] > 0.35


def test_search_climbs_ridges_and_keeps_out_of_what_is_forbidden() -> None:
    best = 1.05, np.exp(-(0.05**2) / 0.02)  # in the middle; where what is allowed begins
    for seed in range(3):
        one = Frontiers(ridge, (seed,), 2)
        searched(one)
        for number in range(2):
            top = one.found(number).settings[0]
            assert top.point[0] > 0.35 and 0.95 * best[number] <= top.value <= best[number]


def test_a_machine_on_which_nothing_is_feasible_stops_no_other() -> None:
    def evaluate(points: Array) -> tuple[Array, Any]:
        return np.zeros((len(points), len(QUANTITIES))), np.zeros(len(points), bool)

    one = Frontiers(evaluate, (0,))
    searched(one, 16)
    assert not any(best.settings for best in one.bests())
    assert len(one.leads().points) == 0


def salt(points: Array) -> tuple[Array, Any]:
    """A hill on which all but a scattered tenth of the points are worth nothing."""
    steps = np.round(points * aims.STEPS).astype(np.int64)
    scattered = (steps @ [7919, 104729, 1299709]) % 211 < 20
    hill = np.exp(-((points - [0.3, 0.95, 0.05]) ** 2).sum(axis=1) / 0.05)
    return np.where(scattered, hill, -1.0)[:, None], np.ones(len(points), bool)


def test_what_is_rugged_is_asked_more_often() -> None:
    """Points that are worth something lie closer than the last samples, but far between."""
    for seed in range(3):
        one = Frontiers(salt, (seed,), 1)
        searched(one)
        assert one.found(0).settings[0].value > 0.9


def test_a_ridge_that_runs_beside_a_hint_is_found() -> None:
    """What is best on another machine is worth nothing here, a few steps beside it."""

    def needle(points: Array) -> tuple[Array, Any]:
        off = np.abs(points - [0.5, 0.5, 0.5]).max(axis=1)
        return np.where(off < 0.004, 2.0, -1.0)[:, None], np.ones(len(points), bool)

    hint = np.array([[0.5, 0.5044, 0.5]])
    for there, found in ((2.0, True), (-1.0, False)):
        one = Frontiers(needle, (0,), 1)
        one.fill(16)
        one.heed(Leads(hint, np.array([[there]])))
        assert bool(one.found(0).settings) is found


def test_what_does_not_grow_is_left_alone_until_a_hint_raises_it() -> None:
    count = [0]

    def evaluate(points: Array) -> tuple[Array, Any]:
        count[0] += len(points)
        low, high = (((points - middle) ** 2).sum(axis=1) for middle in (0.3, 0.8))
        heights = np.maximum(np.exp(-low / 0.02), 2.0 * np.exp(-high / 1e-4))
        return heights[:, None], np.ones(len(points), bool)

    one = Frontiers(evaluate, (0,), 1)
    searched(one, 64)
    before = count[0]
    one.climb(study.LATER, 6)
    assert count[0] == before and one.found(0).settings[0].value < 1.01
    one.heed(Leads(np.full((1, 3), 0.805), np.array([[2.0]])))
    one.climb(study.LATER, 6)
    assert count[0] > before and one.found(0).settings[0].value > 1.9


class Judge:
    """A more complete circuit that bears out nothing near the best that a search has found, and has
    the ridge a few steps beside there."""

    fidelity = Fidelity(0.02, None)

    def __init__(self, middle: float, width: float) -> None:
        self.middle, self.width = middle, width

    def scores(self, case: Case, points: Array) -> tuple[Array, Any]:
        near = np.abs(points[:, 0] - self.middle) < self.width
        found, feasible = ridge(points)
        beside, _ = ridge(points - [0.012, -0.012, 0.0])
        return np.where(near[:, None], 0.8 * beside, 1.01 * found), feasible

    def outcomes(self, every: Any) -> list[Outcome]:
        return [Outcome({}) for _ in every]

    def heat(self, *run: object) -> float:
        return 0.0


@pytest.mark.parametrize("width", [0.03, 0.3])
def test_what_is_refuted_gives_way_to_the_best_that_is_confirmed(
    width: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where all that is confirmed is much poorer, the circuit that refutes is searched itself."""
    one = Frontiers(ridge, (0,), 2)
    searched(one)
    rig = study.Rig("its own rig", {}, {study.OWN: Case({}, Machine())})
    rig.searches[study.OWN], rig.found[study.OWN] = one, one.bests()
    middle = rig.found[study.OWN][0].settings[0].point[0]
    judge: Any = Judge(middle, width)
    tried: list[float] = []

    def judged(bench: Any, cases: Any, chosen: dict[Any, Any]) -> dict[Any, confirm.Point]:
        return {key: point(key, setting) for key, setting in chosen.items()}

    def point(key: confirm.Key, setting: Any) -> confirm.Point:
        there = judge.scores(None, np.array([setting.point]))[0][0, key[1]]
        if key[1] == 0:
            tried.append(there)
        holds = judge.fidelity.agrees(setting.value, there)
        return confirm.Point(*key, setting, 0.0, {}, "amplifier", there, holds)

    monkeypatch.setattr(confirm, "_judged", judged)
    monkeypatch.setattr(confirm, "_on_full", lambda bench, points: points)
    known = study.Study(load("reference"), [], [rig], one.bests())
    top = confirm.confirmed(judge, known, lambda said: None)[study.OWN, 0, "best"]
    assert top.holds and top.refuted > 0
    if width == 0.3:
        assert top.settings["circuit.model"] == "amplifier"
        assert max(tried) * 1.02 < top.judged <= 0.8 * 1.05
        return
    x = np.linspace(0.351, 1.0, 1299)
    heights = ridge(np.stack([x, x, 0.5 + 0.3 * (x - 0.5)], axis=1))[0][:, 0]
    assert top.setting.value > 0.9 * heights[np.abs(x - middle) >= 0.03].max()


def test_a_current_limit_that_acts_is_judged_on_the_circuit_that_has_one(tmp_path: Path) -> None:
    with bench(tmp_path) as made:
        made.scene = changed(made.scene, {"circuit.current_limit": 2.0}, "test")
        judges = {
            (amperes, limit): made.judge(
                Case({}, Machine()),
                {"circuit.current_limit": limit} if limit else {},
                {"current_max": 0.1, "current_min": -amperes},
            )
            for amperes in (0.39, 0.4, 2.0)
            for limit in (0.4, None)
            if amperes <= (limit or 2.0)
        }
        ideal = made.judge(Case({}, Machine(), "ideal"), {}, {})
    assert judges == {
        **{(0.39, 0.4): "amplifier", (0.4, 0.4): "full"},
        **{(0.39, None): "amplifier", (0.4, None): "amplifier", (2.0, None): "full"},
    }
    assert ideal == "ideal"


def test_a_limit_that_costs_is_climbed_on_from_what_the_own_circuit_does_best() -> None:
    """The ridge lies a few steps beside that of the own circuit where the limit acts."""
    middle, asked = 0.5, dict.fromkeys((1e5, 1e9, None), 0)

    class Beside(Judge):
        def scores(self, case: Case, points: Array) -> tuple[Array, Any]:
            slew: Any = case.machine.settings.get("circuit.slew_rate")
            asked[slew] += len(points)
            off = points - middle - (0.006 if slew == 1e5 else 0.0)
            heights = np.exp(-(off**2).sum(axis=1) / 2e-4)
            return np.stack([heights] * len(QUANTITIES), axis=1), np.ones(len(points), bool)

    judge: Any = Beside(middle, 0.0)
    judge.scene = load("reference")
    one = Frontiers(lambda points: judge.scores(Case({}, Machine()), points), (0,))
    one.known.rows(np.full((1, 3), middle))
    rig = study.Rig("its own rig", {}, searches={study.OWN: one})
    found = rig.found[study.OWN] = one.bests()
    slew = replace(BY_NAME["slew rate"], values=(1e5,))
    known = study.Study(judge.scene, [slew], [rig], found)
    points = confirm.judged(judge, known, {}, lambda said: None)
    start = np.exp(-3 * 0.006**2 / 2e-4)
    for quantity in range(len(QUANTITIES)):
        acts, lifted = (points[("slew rate", v), quantity, "best"].judged for v in (1e5, 1e9))
        assert acts > 1.2 * start and lifted > 0.99
    assert asked[1e9] < 20 < asked[1e5]


def test_other_rigs_begin_with_what_is_best_on_the_own_one() -> None:
    """A needle that few places do not find; with twice the amperes it lies at half the turn."""

    class Needle:
        scene = load("reference")

        def amperes(self, case: Case) -> float:
            return 2.0 if case.rig else 1.0

        def scores(self, case: Case, points: Array) -> tuple[Array, Any]:
            turned = points * [self.amperes(case), 1.0, self.amperes(case)]
            heights = np.exp(-((turned - [0.31, 0.42, 0.63]) ** 2).sum(axis=1) / 4e-4)
            return np.stack([heights] * len(QUANTITIES), axis=1), np.ones(len(points), bool)

    needle: Any = Needle()
    few = Effort(8, 0, 0, rounds=0)
    efforts = study.Efforts(Effort(512, 8, 0, rounds=0), few, few, 1)
    found = study.study(needle, [{"mechanics.surface_mass": 0.02}], [], efforts=efforts)
    own, other = (rig.found[study.OWN][0].settings[0].value for rig in found.rigs)
    assert own > 0.8 and other > 0.8
    assert found.again[0].settings[0].value < 0.1


@pytest.mark.usefixtures("brief")
def test_a_killed_study_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    points = np.random.default_rng(0).random((12, 3))
    case, count, add = Case({}, Machine()), [0], Store.add

    def counted(store: Store, key: str, found: Any) -> None:
        add(store, key, found)
        count[0] += 1
        if count[0] == 5:
            raise KeyboardInterrupt

    monkeypatch.setattr(Store, "add", counted)
    with pytest.raises(KeyboardInterrupt), bench(tmp_path) as made:
        made.scores(case, points)
    with bench(tmp_path) as made:
        assert made.resumed == 5
        found, _ = made.scores(case, points)
    with Bench(load("reference"), "", tmp_path / "other", 1) as made:
        np.testing.assert_array_equal(made.scores(case, points)[0], found)


def test_verdicts() -> None:
    """What binds changes a frontier by more than its interval; what does not, by 2 % at most."""

    def verdict(best: tuple[float, ...], robust: tuple[float, ...], noise: float = 0.03) -> str:
        return Change(LIMITS[0], 0, best, robust, (noise, noise)).verdict

    assert verdict((0.2, 0.1), (0.15, 0.05)) == BINDS
    assert verdict((0.2, 0.1), (0.15, -0.05)) == UNTOLD
    assert verdict((0.02, -0.01), (0.0, 0.015)) == NOTHING
    assert verdict((0.025, 0.025), (0.01, 0.01)) == UNTOLD
    assert verdict((float("nan"),), (float("nan"),)) == UNTOLD


def test_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The tables and figures of a small one; each row's command gives the row's value."""
    drawn: list[Figure] = []
    monkeypatch.setattr(Picture, "write", lambda figure, *where: drawn.append(figure))
    monkeypatch.setattr(runs, "SETTLE", 0.02)
    monkeypatch.setattr(runs, "SPAN", 0.05)
    values: dict[str, tuple[float, ...]] = {
        "supply voltage": (24.0,),
        "coil heat": (),
        "DAC steps": (5e-5,),
        "slew rate": (),
    }
    limits = [replace(BY_NAME[name], values=few) for name, few in values.items()]
    efforts = study.Efforts(
        Effort(16, 1, 1, rounds=1), Effort(8, 0, 0, rounds=1), Effort(8, 0, 0, rounds=0), 1
    )
    scene = load("reference", {"run.duration": 0.2})
    rigs = tmp_path / "rigs.json"
    rigs.write_text('{"ensemble": [{}, {"mechanics.surface_mass": 0.02}]}')
    there = [load("trial-05", {"run.duration": 0.15, "run.settle": 0.05})]
    steps: list[tuple[int, int]] = []
    monkeypatch.setattr(report, "FULL", efforts)
    monkeypatch.setattr(report, "LIMITS", limits)
    said = cosim.limits(
        scene, rigs=rigs, at=there, out=tmp_path, workers=2,
        progress=lambda done, total, what: steps.append((done, total)),
    )  # fmt: skip
    assert steps == [(k, len(steps)) for k in range(1, len(steps) + 1)]
    assert "The part slips down from 50 m/s² on" in repr(said) and not (tmp_path / STORE).exists()
    with open(tmp_path / "limits.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["limit"] for row in rows} == {"own", "ideal current", *(x.name for x in limits)}
    for row in (rows[0], rows[-1]):
        repeats(row, tmp_path)
    assert all(float(row["heat of a coil [W]"]) < 3.53 for row in rows if row["limit"] == "own")
    # What the own circuit does best is allowed where the coil bears any heat.
    best = {
        (row["limit"], row["quantity"]): float(row["found"])
        for row in rows
        if row["setting"] == "best" and row["limit"] in ("own", "coil heat")
    }
    for (limit, quantity), value in best.items():
        if limit == "own":
            assert best["coil heat", quantity] >= 0.98 * value, quantity
    page = (tmp_path / "limits.md").read_text(encoding="utf-8")
    assert all(f"| {limit.name} |" in page for limit in limits) and "| trial-05 |" in page
    assert len(drawn) == 4 + 2  # and those of the two commands
    for figure in drawn[:4]:
        assert_legible(figure)


def repeats(row: dict[str, str], folder: Path) -> None:
    """Run a row's command and compare its summary with the row."""
    words = shlex.split(row["command"])[1:]
    assert main([*words, "--out", str(folder / "again")]) == 0
    summary = json.loads((folder / "again" / "summary.json").read_text())
    quantity = QUANTITIES[NUMBER[row["quantity"]]]
    value = quantity.of(summary) * quantity.scale
    assert value == pytest.approx(float(row["found"]), rel=1e-6)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["held"], 'scene held: circuit.model = "none" has no limits to lift'),
        (["square"], 'scene square: drive.waveform = "square" has no knobs'),
        (["paper", "--rigs", "rigs.json"], "rigs.json: cannot be read"),
        (["paper", "--effort", "nan"], "--effort nan: must be from 0.01 to 100"),
        (["paper", "--seed", "-1"], "--seed -1: must be a whole number from 0"),
    ],
)
def test_bad_input(
    arguments: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["chart", "limits", *arguments, "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert words in said and said.count("\n") == 1
    assert not out.exists()


def test_ensemble(tmp_path: Path) -> None:
    path = tmp_path / "rigs.json"
    rigs = [{"cost": n, "mechanics.surface_mass": 0.01 + 0.001 * n} for n in range(7)]
    rigs[6] |= {"normal_force_ratio": 0.8, "mechanics.suspension": "knee"}
    path.write_text(json.dumps({"ensemble": rigs, "seed": 0}))
    found = study.ensemble(path, 3, 2.0)
    assert [round(1e3 * float(rig["mechanics.surface_mass"])) for rig in found] == [12, 14, 16]
    assert [rig.get("friction.normal_force") for rig in found] == [None, None, 1.6]
    scene = load("paper")
    study.checked(scene, found, path)
    with pytest.raises(BadInput, match=r"rigs\.json, ensemble 0: .*surface_mass"):
        study.checked(scene, [{"mechanics.surface_mass": -1.0}], path)
    for text in ("[]", "{}", '{"ensemble": [1]}'):
        path.write_text(text)
        with pytest.raises(BadInput, match="has no list"):
            study.ensemble(path, 3, 2.0)
    path.write_text("{")
    with pytest.raises(BadInput, match="neither JSON"):
        study.ensemble(path, 3, 2.0)
