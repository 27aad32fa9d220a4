"""The keys of a scene that a study may change."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from cosim.errors import BadInput, plain
from cosim.scene import KEYS, Key, Scene, changed
from cosim.scene.loading import parted
from cosim.scene.messages import ended, suggestion
from cosim.scene.tables import KNOBS, LEVEL_KEY, PARAM_KEY, said_twice

FREQUENCIES = ("drive.frequency", "drive.pot_frequency", "drive.loop_time")


def numeric_key(name: str) -> Key:
    """The key with this full name. Raises BadInput for one that is unknown or no number."""
    numeric = {full: key for full, key in KEYS.items() if key.kind in (int, float)}
    if name in numeric:
        return numeric[name]
    table, _, bare = name.partition(".")
    if table == "drive" and LEVEL_KEY.fullmatch(bare):
        text = f"Level of pair {bare.partition('.')[2]} of drive.table"
        return Key(table, bare, "1", None, float, None, -0.5, 0.5, text, "")
    param = table == "circuit" and PARAM_KEY.fullmatch(bare)
    if param or (table == "fmu" and "." in bare):
        text = f"Value of {bare}, of the user's own"
        return Key(table, bare, "?", None, float, None, -1e30, 1e30, text, "")
    if name in KEYS:
        raise BadInput(f"--over {plain(name)}: this key is not a number.")
    bare = [full for full, key in numeric.items() if key.name == name]
    hint = f"; did you mean {bare[0]}?" if bare else suggestion(name, numeric)
    raise BadInput(ended(f"--over {plain(name)}: there is no such key{hint}"))


def split(options: Sequence[str], form: str) -> Iterator[tuple[str, str, str]]:
    """Each option of this form, its key, which no other one has, and its values; BadInput."""
    names: set[str] = set()
    for text in options:
        name, _, right = (part.strip() for part in parted(text))
        if not (name and right):
            raise BadInput(f"--over {plain(text)}: must be {form}.")
        if name in names:
            raise BadInput(f"--over {plain(name)}: this key is given twice.")
        names.add(name)
        yield text, name, right


def refuse_unknown(scene: Scene, names: Iterable[str]) -> None:
    """Raise BadInput where one of the keys ``table.key`` is no level of the drive's table, no
    ``.param`` of the scene's netlist or no parameter of its FMUs, or says what another one says."""
    names = [*names]
    for knob, name in KNOBS.items():  # else each run would fail by itself
        both = f"drive.{knob}", f"drive.{name}"
        if set(both) <= set(names):
            raise BadInput(f"--over: {said_twice(*both)}.")
    levels = [name for name in names if LEVEL_KEY.fullmatch(name.removeprefix("drive."))]
    if levels:
        changed(scene, dict.fromkeys(levels, 0.0), "--over")
    own = [name for name in names if name.startswith(("circuit.param.", "fmu."))]
    if not own:
        return
    # What only such a scene needs is imported here, since it takes a while.
    from cosim.circuit.joined import own_parameters
    from cosim.circuit.lint.deck import read
    from cosim.circuit.lint.elements import parse
    from cosim.circuit.netlist import path_of
    from cosim.simulation.elsewhere import bounds, refuse_missing, told
    from cosim.toolchain.processes import isolated

    refuse_missing(scene)
    given = dict.fromkeys(own, "--over")
    scene = changed(scene, dict.fromkeys(own, 0.0), "--over").of(scene.origin, given)
    if scene.circuit.param and not scene.rung.ngspice:
        raise BadInput(
            f'--over {own[0]}: moves nothing with circuit.model = "{scene.circuit.model}", whose '
            "circuit ngspice does not solve."
        )
    files = {fmu.name: fmu.file for fmu in scene.fmu}
    asked = [(files[name.split(".")[1]], name) for name in own if name.startswith("fmu.")]
    with told(scene):
        if scene.circuit.param:
            path = path_of(scene)
            own_parameters(parse(read(path)[0]), plain(path), scene.circuit.param)
        if asked:
            isolated(_known, asked, lambda _: None, bounds(scene))


def _known(asked: Sequence[tuple[str, str]], progress: Any) -> None:
    """Of an FMU's file and a key that is to be a parameter of it."""
    from cosim.coupling.ports.strangers import stranger

    for file, name in asked:
        stranger(file).settable(name.split(".", 2)[2], plain(name))
