"""The keys of a scene that a study may change."""

from collections.abc import Iterator, Sequence

from cosim.errors import BadInput, plain
from cosim.scene import Key, keys
from cosim.scene.messages import ended, suggestion
from cosim.scene.tables import LEVEL_KEY, PARAM_KEY

FREQUENCIES = ("drive.frequency", "drive.pot_frequency", "drive.loop_time")


def numeric_key(name: str) -> Key:
    """The key with this full name. Raises BadInput for one that is unknown or no number."""
    numeric = {key.full: key for key in keys() if key.kind in (int, float)}
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
    if any(key.full == name for key in keys()):
        raise BadInput(f"--over {plain(name)}: this key is not a number.")
    bare = [full for full, key in numeric.items() if key.name == name]
    hint = f"; did you mean {bare[0]}?" if bare else suggestion(name, numeric)
    raise BadInput(ended(f"--over {plain(name)}: there is no such key{hint}"))


def split(options: Sequence[str], form: str) -> Iterator[tuple[str, str, str]]:
    """Each option of this form, its key, which no other one has, and its values; BadInput."""
    names: set[str] = set()
    for text in options:
        name, _, right = (part.strip() for part in text.partition("="))
        if not (name and right):
            raise BadInput(f"--over {plain(text)}: must be {form}.")
        if name in names:
            raise BadInput(f"--over {plain(name)}: this key is given twice.")
        names.add(name)
        yield text, name, right
