"""Scenes: defaults, layers, overrides, knobs, and the way to text and back."""

import re
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path
from typing import Any

import fmpy
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim.errors import BadInput, NoEffect, Note
from cosim.mechanics import package
from cosim.scene import KEYS, RUNGS, Key, Scene, changed, list_scenes, load, to_toml
from cosim.scene.rungs import METHODS
from cosim.scene.tables import Circuit, Coupling
from tests.helpers.examples import examples

# The table of the design, written down once more: an accidental change of a default shows here.
DEFAULTS: dict[str, dict[str, Any]] = {
    "drive": {
        "waveform": "sawtooth",
        "table": None,
        "duty": 0.5,
        "frequency": 20,
        "amplitude": 8.0,
        "offset": -1.2,
        "reset_time": 0,
        "start_time": 0.0,
        "start_phase": 0.0,
        "phase_deg": None,
        "acceleration_max": 98.1,
        "optimum": "up",
        "velocity_amplitude": 0.1,
        "file": None,
        "quantised": False,
        "loop_time": 0,
        "pwm_ripple": False,
        "pot_max": None,
        "pot_frequency": None,
        "pot_offset": None,
    },
    "circuit": {
        "model": "amplifier",
        "supply": 18,
        "save": None,
        "param": None,
        "netlist": None,
        "sense_resistance": 4,
        "current_limit": 2.504,
        "gain_bandwidth": 1e6,
        "open_loop_gain": 98,
        "slew_rate": 10e6,
        "swing_loss_high": 4.0,
        "swing_loss_low": 4.0,
        "output_resistance": 0,
        "snubber_resistance": None,
        "snubber_capacitance": None,
        "reltol": 3e-5,
        "max_step": 1.4e-4,
    },
    "coil": {
        "resistance": 7.1,
        "inductance": 1.2e-3,
        "eddy_inductance": None,
        "eddy_resistance": None,
        "force_factor": 0.6,
        "b1": 0,
        "b2": 0,
        "polarity": 1,
        "winding_to_body": 10.0,
        "winding_capacity": 0.75,
        "body_to_air": 40.0,
        "body_capacity": 7.8,
        "count": 1,
    },
    "mechanics": {
        "actuator": "ram",
        "ram_mass": 0.004,
        "surface_mass": 0.0145,
        "part_mass": 0.009,
        "flexure_stiffness": 560,
        "flexure_damping": 0.84,
        "suspension": "cubic",
        "suspension_k1": 40,
        "suspension_k2": 0,
        "suspension_k3": 1.5e7,
        "suspension_knee": 0,
        "suspension_hardening": 4e5,
        "suspension_repulsion": 0.05,
        "suspension_distance": 2.8e-3,
        "suspension_damping": 0.02,
        "travel": 1.9e-3,
        "contact": "compliant",
        "restitution": 0.75,
        "contact_stiffness": 1e8,
        "contact_damping": 0.38,
        "n_surfaces": 1,
        "gravity": 9.81,
        "tolerance": 1e-8,
        "initial_lift": 0.0,
    },
    "friction": {
        "law": "coulomb",
        "mu_s": 0.72,
        "mu_k": 0.59,
        "normal_force": 0.5,
        "normal_force_file": None,
        "mu_plate": 0,
    },
    "coupling": {"method": "step-locked", "macro_step": 1e-4, "order": 1, "tolerance": 1e-3},
    "run": {
        **{
            "duration": 2.0,
            "settle": 0.8,
            "output_step": 5e-5,
            "shutter": 0.0,
            "tolerance": 1e-2,
        },
        **{"average": "ends", "solver": "fmu", "step": 4.3e-5},
    },
}


def written(directory: Path, text: str, name: str = "mine.toml") -> Path:
    path = directory / name
    path.write_text(text, encoding="utf-8")
    return path


def test_reference_is_the_defaults() -> None:
    scene = load("reference")
    assert {table: getattr(scene, table).model_dump() for table in DEFAULTS} == DEFAULTS
    bare = {"name": scene.name, "description": scene.description}
    assert scene == Scene.model_validate(bare)


FILES = ("circuit.netlist", "drive.file", "friction.normal_force_file")


def test_every_key_is_described() -> None:
    assert {(key.table, key.name) for key in KEYS.values()} == {
        (table, name) for table, names in DEFAULTS.items() for name in names
    }
    for key in KEYS.values():
        assert key.text and "\n" not in key.text
        assert key.default == DEFAULTS[key.table][key.name]
        numeric = key.kind in (int, float)
        assert bool(key.unit) == numeric, key.full
        if numeric:
            assert key.low is not None and key.high is not None and key.low < key.high
            assert key.default is None or key.low <= float(key.default) <= key.high
        else:
            free = key.kind in (bool, list) or key.full in FILES
            assert free or (key.choices and key.default in key.choices)


@pytest.fixture(scope="module")
def fmu_variables() -> dict[str, Any]:
    """The variables of the built FMU by name, read by FMPy."""
    description = fmpy.read_model_description(str(package.unpacked(3)))
    return {variable.name: variable for variable in description.modelVariables}


# The FMU takes 0 for an absent eddy branch; a scene leaves the keys out.
ABSENT = {"coil.eddy_inductance": (None, 1e-9), "coil.eddy_resistance": (None, 1e-3)}


def test_keys_of_the_mechanics_are_those_of_the_fmu(fmu_variables: dict[str, Any]) -> None:
    shared = [key for key in KEYS.values() if key.variable]
    assert len(shared) > 25
    for key in shared:
        variable = fmu_variables[key.variable]
        assert variable.causality in ("parameter", "input"), key.full
        assert (key.unit, key.text) == (variable.unit or "1", variable.description), key.full
        start, low = ABSENT.get(key.full, (float(variable.start), float(variable.min)))
        assert (key.default, key.low) == (start, low), key.full
        assert key.high == float(variable.max), key.full


def test_parameters_of_the_fmu_that_are_no_keys(fmu_variables: dict[str, Any]) -> None:
    """Every other parameter of the FMU is one that the program sets or leaves alone."""
    parameters = {name for name, v in fmu_variables.items() if v.causality == "parameter"}
    assert parameters - {key.variable for key in KEYS.values()} == {
        "output_high", "output_low",  # from supply and swing losses
        "contact", "suspension", "ram_fixed", "independent", "prescribed", "source",
    }  # fmt: skip


def test_every_key_of_circuit_and_coupling_acts_somewhere() -> None:
    of_rungs = set().union(*(rung.keys for rung in RUNGS.values()))
    assert of_rungs == set(Circuit.model_fields) - {"model"}
    chosen = set().union(*(method.chooses for method in METHODS.values()))
    assert chosen <= of_rungs
    of_methods = set().union(*(method.keys for method in METHODS.values()))
    assert of_methods == set(Coupling.model_fields) - {"method"}


def test_built_in_scenes() -> None:
    scenes = dict(list_scenes())
    assert next(iter(scenes)) == "paper"
    assert set(scenes) == {
        "paper", "paper-full", "paper-knee", "paper-limited", "gripper", "ideal-current", "held",
        "optimal", "quaid", "trial", "umbanhowar",
        "direct-drive", "direct-drive-stops", "gripper-17g", "gripper-169g", "square",
        "down-grip", "down-waveform", "closed-loop-grasp", "two-surfaces", "reference",
        "dc-motor", "relay", "closed-grip",
        *(f"trial-{n:02}" for n in range(1, 11)),
    }  # fmt: skip
    for name, description in scenes.items():
        scene = load(name)
        assert (scene.name, scene.description) == (name, description)
        assert description
    assert load("paper-full").circuit.model == "full"
    assert load("paper-limited").circuit.model == "limited"
    assert load("ideal-current").circuit.model == "ideal"
    assert load("held").circuit.model == "none"
    gripper = load("gripper")
    assert (gripper.coil.count, gripper.mechanics.n_surfaces) == (2, 2)
    weight = gripper.mechanics.part_mass / 2 * gripper.mechanics.gravity
    assert weight < gripper.friction.mu_s * gripper.friction.normal_force


def test_no_circuit_has_the_staircase_unless_asked() -> None:
    """It costs ten times the time and changes v_average of `paper` by 0.3 %."""
    assert not load("paper-full").drive.quantised
    assert load("paper-full", ["drive.quantised=true"]).drive.quantised


@pytest.mark.parametrize(
    ("file", "cure"),
    [
        ("mine.cir", "cosim new --kind circuit "),
        ("mine.fmu", "cosim new --kind fmu "),
        ("mine.csv", "cosim compare "),
    ],
)
def test_what_a_scene_names_is_no_scene(file: str, cure: str) -> None:
    with pytest.raises(BadInput, match=rf"^{file}: must be a scene, .* {cure}"):
        load(file)


def test_of_a_runs_folder_the_scene_is_named(tmp_path: Path) -> None:
    file = written(tmp_path, "").rename(tmp_path / "scene.toml")
    with pytest.raises(BadInput, match=f"this run's is {re.escape(str(file))}"):
        load(tmp_path)


def test_all_unknown_names_are_told_at_once(tmp_path: Path) -> None:
    path = written(tmp_path, "[drive]\nfrequncy = 20\namplitud = 3\n[cirucit]\n")
    with pytest.raises(BadInput) as caught:
        load(path)
    assert str(caught.value) == (
        f'{path}: there is no key "drive.frequncy"; did you mean drive.frequency? There is no key '
        '"drive.amplitud"; did you mean drive.amplitude? There is no table "cirucit"; did you mean '
        "circuit?"
    )


def test_unknown_names_in_lists_are_told_with_the_others(tmp_path: Path) -> None:
    path = written(tmp_path, '[[port]]\nform = "a"\nsorce = "V1"\n[drvie]\n')
    with pytest.raises(BadInput) as caught:
        load(path)
    assert re.findall(r"did you mean (\w+)\?", str(caught.value)) == ["from", "source", "drive"]


def test_the_first_five_wrong_values_are_told_at_once_with_their_layers(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        "[drive]\ntable = [1, 'b']\nfrequency = -1\n[[fmu]]\nfile = 'r'\n[run]\nduration = 0\n",
    )
    with pytest.raises(BadInput) as caught:
        load(path, ["drive.offset=x", "coil.inductance=x"])
    assert str(caught.value) == (
        f"{path}: drive.table = 1 must be a list of 1 to 64 pairs of numbers, [[phase, level], "
        "...]. drive.frequency = -1 must be a number from 0.01 to 100000 Hz. --set: drive.offset = "
        '"x" must be a number from -100 to 100 V. coil.inductance = "x" must be a number from '
        f"1e-09 to 1000 H. {path}: run.duration = 0 must be a number from 1e-06 to 100000 s."
    )


def test_file_changes_only_its_keys(tmp_path: Path) -> None:
    path = written(tmp_path, "[mechanics]\ntravel = 2e-3\n[coil]\nforce_factor = 1\n")
    scene = load(str(path))
    assert scene.name == "mine"
    assert scene.mechanics.travel == 2e-3
    assert scene.coil.force_factor == 1.0 and isinstance(scene.coil.force_factor, float)
    assert scene.mechanics.model_copy(update={"travel": 1.9e-3}) == load("reference").mechanics


def test_a_file_that_says_nothing_is_told(tmp_path: Path) -> None:
    with pytest.warns(Note, match=r"mine\.toml: this file says nothing"):
        scene = load(written(tmp_path, "# [drive]\n"))
    assert scene == Scene(name="mine", description="")


def test_file_on_a_base(tmp_path: Path) -> None:
    path = written(tmp_path, 'base = "gripper"\n[drive]\nfrequency = 30\n', "my scene.toml")
    scene, gripper = load(path), load("gripper")
    assert scene.name == "my-scene"
    assert scene.description == ""
    assert scene.drive.frequency == 30.0
    assert scene.drive.amplitude == gripper.drive.amplitude
    assert scene.mechanics == gripper.mechanics


@pytest.mark.parametrize(
    ("option", "table", "key", "value"),
    [
        ("run.duration=3", "run", "duration", 3.0),
        ("run.duration = 3e0", "run", "duration", 3.0),
        ("circuit.model=ideal", "circuit", "model", "ideal"),
        ('circuit.model="ideal"', "circuit", "model", "ideal"),
        ("mechanics.contact='rigid'", "mechanics", "contact", "rigid"),
        ("drive.quantised=true", "drive", "quantised", True),
        ("drive.offset=-0.5", "drive", "offset", -0.5),
        ("drive.offset=-.5", "drive", "offset", -0.5),
        ("drive.offset=2.", "drive", "offset", 2.0),
        ("coil.count=2", "coil", "count", 2),
        ("mechanics.suspension_k3=1_000_000", "mechanics", "suspension_k3", 1e6),
    ],
)
def test_override(option: str, table: str, key: str, value: object) -> None:
    assert getattr(getattr(load("paper", [option]), table), key) == value


def test_last_override_wins() -> None:
    assert load("paper", ["run.duration=3", "run.duration=4"]).run.duration == 4.0


@pytest.mark.parametrize(
    "overrides, periods, length",
    [
        (["drive.frequency=20.78"], 24, 1 / 20.78),
        (["drive.frequency=30", "run.duration=0.5"], 6, 1 / 30),
        (["drive.frequency=3", "run.duration=0.5"], 1, 1 / 3),
        # The firmware's staircase: 1/30 s in whole steps of 50 us
        (["drive.frequency=30", "drive.quantised=true"], 24, 0.03335),
    ],
)
def test_averages_are_over_whole_periods(overrides: list[str], periods: int, length: float) -> None:
    scene = load("paper", overrides)
    assert scene.period == pytest.approx(length, rel=1e-12)
    assert scene.run.duration - scene.run.settle == pytest.approx(periods * length, rel=1e-12)


@pytest.mark.parametrize("half", [*range(1, 60)])
def test_motion_that_repeats_after_some_periods_does_so_within_the_average(half: int) -> None:
    """About as many periods as half of the run has, and a multiple of what they are enough for."""
    scene = load("paper", ["drive.frequency=50", f"run.duration={(2 * half + 0.5) / 50}"])
    periods = round((scene.run.duration - scene.run.settle) * 50, 9)
    assert abs(periods / half - 1) <= 1 / 3 + 1e-9
    assert all(periods % n == 0 for n in (2, 3, 4, 6, 8) if periods >= 3 * n)


def test_a_given_settle_stays() -> None:
    assert load("paper", ["run.duration=0.5", "run.settle=0.1"]).run.settle == 0.1
    assert load("paper", ["run.duration=0.02"]).run.settle == 0.01  # less than a period


def test_another_frequency_moves_only_a_settle_that_was_not_given() -> None:
    for own, settle in (([], 2.0 - 24 / 30.5), (["run.settle=1"], 1.0)):
        here, there = load("paper", own), {"drive.frequency": 30.5}
        for scene in (changed(here, there, "here"), load(here, there)):
            assert scene.run.settle == pytest.approx(settle, rel=1e-12)
    assert load(load("paper"), {"run.duration": 0.02}).run.settle == 0.01


@pytest.mark.parametrize("change", ["drive.frequency=30.5", "run.duration=0.5"])
def test_a_written_scene_averages_over_whole_periods_too(change: str, tmp_path: Path) -> None:
    for own in ([], ["run.settle=0.1"]):
        there = load(written(tmp_path, to_toml(load("paper", own)), "paper.toml"), [change])
        assert there.run == load("paper", [*own, change]).run


def test_knobs_stand_for_values() -> None:
    scene = load("paper", ["drive.pot_max=0.75", "drive.pot_frequency=0.5", "drive.pot_offset=0.3"])
    # by hand: readings 768, 512 and 307 of 1024; 3.3 V full scale; 15/4.7 of gain
    assert scene.drive.amplitude == pytest.approx(0.75 * 3.3 * 15 / 4.7)
    assert scene.drive.frequency == 50.5
    top = 307 / 1024 * 3.3 * 15 / 4.7
    assert scene.drive.offset == pytest.approx(top - scene.drive.amplitude / 2)


@pytest.mark.parametrize(
    ("pot", "frequency"), [(0.0, 100.0), (0.25, 75.25), (0.9999, 1.0966796875), (1, 1.0966796875)]
)
def test_frequency_knob(pot: float, frequency: float) -> None:
    assert load("paper", [f"drive.pot_frequency={pot}"]).drive.frequency == frequency


def test_knob_and_value_replace_each_other_between_layers(tmp_path: Path) -> None:
    path = written(tmp_path, "[drive]\npot_max = 0.5\n")
    assert load(path).drive.amplitude == pytest.approx(5.266, abs=1e-3)
    scene = load(path, ["drive.amplitude=3"])
    assert (scene.drive.amplitude, scene.drive.pot_max) == (3.0, None)
    with pytest.raises(BadInput, match=r"drive\.pot_max and drive\.amplitude"):
        load("paper", ["drive.pot_max=0.5", "drive.amplitude=3"])


def test_text_is_deterministic_and_complete() -> None:
    scene = load("reference")
    text = to_toml(scene)
    assert text == to_toml(load("reference"))
    fitted = {"run.settle": scene.run.settle, "run.output_step": scene.run.output_step}
    for key in KEYS.values():
        stands = key.default is not None and key.full not in fitted
        assert (f"\n{key.name} = " in text) == stands, key.full
        (line,) = (line for line in text.splitlines() if line.endswith(key.text))
        shown = fitted.get(key.full, "")
        assert line.startswith(f"{key.name} = " if stands else f"# {key.name} = {shown}  # ")
        assert key.unit in ("", "1") or f"  # {key.unit}; {key.text}" in line
    assert "\nfrequency = 20.0  # Hz; Frequency; " in text


def test_text_tells_what_a_knob_stands_for(tmp_path: Path) -> None:
    scene = load("paper", ["drive.pot_max=0.7"])
    text = to_toml(scene)
    assert "\n# amplitude = 7.364112367021276  # V; Peak-to-peak voltage at V1\n" in text
    assert "instead of amplitude; amplitude 7.364 V\n" in text
    assert load(written(tmp_path, text, "paper.toml")) == scene.model_copy(update={"name": "paper"})


@pytest.mark.parametrize("name", [name for name, _ in list_scenes()])
def test_built_in_scenes_come_back(name: str, tmp_path: Path) -> None:
    scene = load(name)
    assert load(written(tmp_path, to_toml(scene))) == scene


def _values(key: Key) -> st.SearchStrategy[Any]:
    if key.choices:
        return st.sampled_from(key.choices)
    if key.kind is bool:
        return st.booleans()
    if key.kind is str:
        return st.just("/somewhere/own.cir")
    if key.kind is int:
        return st.integers(int(key.low or 0), int(key.high or 0))
    if key.kind is list:
        pairs = st.tuples(st.floats(0.0, 1.0), st.floats(-0.5, 0.5)).map(list)
        return st.lists(pairs, min_size=1, max_size=5).map(sorted)
    assert key.low is not None and key.high is not None
    return st.floats(key.low, key.high)


TEXT = st.text(st.characters(exclude_categories=["Cc", "Cs"]), max_size=50)
SOME_KEYS = st.lists(st.sampled_from([*KEYS.values()]), max_size=6, unique=True)


@examples(150)
@given(chosen=SOME_KEYS, description=TEXT, data=st.data())
def test_any_scene_comes_back(chosen: list[Key], description: str, data: st.DataObject) -> None:
    tables: dict[str, Any] = {"name": "any", "description": description}
    for key in chosen:
        tables.setdefault(key.table, {})[key.name] = data.draw(_values(key), label=key.full)
    try:
        scene = Scene.model_validate(tables)
    except ValueError:
        return  # values that do not go together
    with tempfile.TemporaryDirectory() as directory:
        assert load(written(Path(directory), to_toml(scene))) == scene
    assert Scene.model_validate(scene.as_dict()) == scene


def test_netlist_is_seen_from_the_file_that_names_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "deep").mkdir()
    monkeypatch.chdir(tmp_path)
    text = '[circuit]\nmodel = "file"\nnetlist = "my.cir"\n'
    (tmp_path / "deep" / "rig.toml").write_text(text, encoding="utf-8")
    assert load("deep/rig.toml").circuit.netlist == str(tmp_path / "deep" / "my.cir")
    given = load("paper", ["circuit.model=file", "circuit.netlist=my.cir"])
    assert given.circuit.netlist == str(tmp_path / "my.cir")


OF_THE_LIMIT = 'it acts in "full", "limited" or "file".'
ALL_BUT_NONE = 'it acts in "full", "amplifier", "limited", "ideal" or "file".'


@pytest.mark.parametrize(
    ("scene", "change", "why"),
    [
        ("paper", "circuit.current_limit=3", f'circuit.model = "amplifier"; {OF_THE_LIMIT}'),
        ("paper-full", "circuit.swing_loss_low=3", 'it acts in "amplifier", "limited" or "file".'),
        (
            "ideal-current",
            "circuit.supply=3",
            'it acts in "full", "amplifier", "limited" or "file".',
        ),
        ("paper-limited", "circuit.slew_rate=1e5", 'it acts in "full", "amplifier" or "file".'),
        ("paper-limited", "circuit.gain_bandwidth=1e5", 'in "full", "amplifier" or "file".'),
        ("ideal-current", "circuit.reltol=1e-5", 'it acts in "full", "amplifier" or "file".'),
        ("held", "circuit.sense_resistance=5", f'circuit.model = "none"; {ALL_BUT_NONE}'),
        ("held", "coil.resistance=5", f'circuit.model = "none"; {ALL_BUT_NONE}'),
        ("held", "drive.frequency=30", f'drive.waveform = "sawtooth"; {ALL_BUT_NONE}'),
        ("optimal", "drive.amplitude=3", f'drive.waveform = "optimal"; {ALL_BUT_NONE}'),
        ("quaid", "drive.velocity_amplitude=3", 'in "none" with drive.waveform = "sine".'),
        ("paper", "drive.acceleration_max=3", 'drive.waveform = "optimal" or "quaid".'),
    ],
)
def test_keys_of_no_effect_are_told(tmp_path: Path, scene: str, change: str, why: str) -> None:
    full, _, value = change.partition("=")
    table, _, key = full.partition(".")
    path = written(tmp_path, f'base = "{scene}"\n[{table}]\n{key} = {value}\n')
    for source, options, origin in ((scene, [change], "--set"), (path, [], str(path))):
        with pytest.warns(NoEffect) as caught:
            load(source, options)
        (said,) = [str(warning.message) for warning in caught]
        assert said.startswith(f"{origin}: {full} has no effect with circuit.model = ")
        assert said.endswith(why)


@pytest.mark.parametrize(
    ("key", "value", "with_it"),
    [
        ("mechanics.restitution", "0.5", 'mechanics.contact = "rigid"'),
        ("mechanics.suspension_knee", "-1e-4", 'mechanics.suspension = "knee"'),
        ("mechanics.suspension_distance", "4e-3", 'mechanics.suspension = "repulsion"'),
        ("run.step", "1e-5", 'run.solver = "fast"'),
    ],
)
def test_a_key_of_another_law_is_told_and_acts_with_its_own(
    key: str, value: str, with_it: str
) -> None:
    choice, _, acting = with_it.partition(" = ")
    with pytest.warns(NoEffect) as caught:
        load("paper-limited", [f"{key}={value}"])
    (said,) = [str(warning.message) for warning in caught]
    assert said.startswith(f"--set: {key} has no effect with {choice} = ")
    assert said.endswith(f"; it acts with {acting}.")
    with warnings.catch_warnings():
        warnings.simplefilter("error", NoEffect)
        load("paper-limited", [f"{choice}={acting}", f"{key}={value}"])


@pytest.mark.parametrize("change", ["coil.inductance=1.3", "mechanics.travel=1.9"])
def test_numbers_that_are_likely_not_in_si_units_are_told_once(change: str) -> None:
    key, _, value = change.partition("=")
    with pytest.warns(Note, match=f"{key} = {value} . is far from the usual") as caught:
        load(load("paper-limited", [change]), {"run.settle": 1.0})
    assert len(caught) == 1


@pytest.mark.parametrize(
    ("scene", "changes"),
    [
        ("paper", ["circuit.current_limit=2.504"]),  # changes nothing
        ("paper", ["circuit.model=full", "circuit.current_limit=3"]),
        ("paper-limited", ["circuit.current_limit=3", "circuit.supply=20", "coil.resistance=6"]),
        ("ideal-current", ["circuit.sense_resistance=5", "coil.inductance=1e-3"]),
        ("gripper", ["circuit.model=none"]),  # the base's own keys
        ("held", ["drive.waveform=sine", "drive.frequency=3", "drive.velocity_amplitude=0.2"]),
        ("optimal", ["drive.optimum=down", "drive.acceleration_max=50"]),
        ("trial", ["drive.file=trial.csv"]),
    ],
)
@pytest.mark.filterwarnings("error")
def test_keys_of_use_are_not_told(tmp_path: Path, scene: str, changes: list[str]) -> None:
    resolved = written(tmp_path, to_toml(load(scene, changes)), "resolved.toml")
    for model in ("full", "amplifier", "limited", "ideal", "none"):
        waveform = load(resolved).drive.waveform
        if model != "none" and waveform != "sawtooth":
            continue
        assert load(resolved, [f"circuit.model={model}"]).circuit.model == model


def test_swing_losses_bound_the_supply_only_where_they_act() -> None:
    assert load("reference", ["circuit.model=full", "circuit.supply=3"]).circuit.supply == 3
    for model in ("amplifier", "limited"):
        with pytest.raises(BadInput, match=r"swing_loss_high = 4 V must be below"):
            load("reference", [f"circuit.model={model}", "circuit.supply=3"])


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        (["coil.inductance=1e-5"], "coil.inductance = 1e-05 H must be at least 1.11e-05 H"),
        (
            ["coil.eddy_inductance=1e-6", "coil.eddy_resistance=5"],
            "coil.eddy_inductance = 1e-06 H must be at least 5e-06 H",
        ),
        (
            ["coil.eddy_inductance=1e-2", "coil.eddy_resistance=2000"],
            "coil.inductance = 0.0012 H must be at least 0.00201 H",
        ),
    ],
)
def test_a_coil_too_fast_to_solve_with_the_mechanics_is_refused(
    changes: list[str], why: str
) -> None:
    load("paper", changes)
    with pytest.raises(BadInput) as caught:
        load("paper-limited", changes)
    assert f'--set: {why} with circuit.model = "limited"' in str(caught.value)


@pytest.mark.filterwarnings("error")
def test_a_file_of_ones_own_runs_with_another_circuit_on_top(tmp_path: Path) -> None:
    text = '[circuit]\nmodel = "full"\ncurrent_limit = 3\n[drive]\nfrequency = 30\n'
    path = written(tmp_path, text)
    for model in ("amplifier", "limited", "ideal", "none"):
        assert load(path, [f"circuit.model={model}"]).circuit.current_limit == 3


def test_scenes_are_frozen() -> None:
    with pytest.raises(ValueError):
        load("paper").run.duration = 3.0  # type: ignore[misc]


def test_nothing_heavy_is_imported() -> None:
    code = (
        "import sys, cosim.scene, cosim.drive.command\n"
        "print(*{'matplotlib', 'scipy', 'fmpy', 'PySpice'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"run.average": "slope", "run.settle": 0.1995}, "less than two frames"),
        ({"run.average": "slope", "run.duration": 1e-3}, "run.settle = 0.0005 s leaves less than"),
        ({"run.settle": 0.2 - 1e-12}, "must be below run.duration"),
        ({"run.settle": 0.2 - 1e-10}, "run.settle = 0.1999999999 s must be below"),
    ],
)
def test_averages_need_something_to_average(settings: dict[str, Any], said: str) -> None:
    with pytest.raises(BadInput, match=said):
        load("paper-limited", {"run.duration": 0.2, **settings})


def test_a_short_run_may_average_by_the_slope() -> None:
    scene = load("paper-limited", {"run.duration": 0.5, "run.average": "slope"})
    assert scene.run.settle == load("paper-limited", {"run.duration": 0.5}).run.settle


def test_a_motion_from_a_file_is_averaged_over_all_of_it(tmp_path: Path) -> None:
    """It has no period that a whole number of could be taken of."""
    rows = "time [s],v_surface [m/s]\n0,0\n0.02,0.1\n0.05,0\n"
    (tmp_path / "motion.csv").write_text(rows)
    (tmp_path / "given.toml").write_text(
        'base = "reference"\n[drive]\nwaveform = "file"\nfile = "motion.csv"\n'
        '[circuit]\nmodel = "none"\n[run]\nduration = 0.05\n'
    )
    assert load(tmp_path / "given.toml").run.settle == 0.0
