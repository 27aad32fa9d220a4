"""The package's imports: no circle, every arrow between folders downwards, few floors.

Imports inside functions and under TYPE_CHECKING count as all others: they, too, are what a reader
must know. The floors follow from the imports, so there is no list to keep.
"""

import ast
from collections import defaultdict
from functools import cache
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "cosim"
FLOORS = 9
FILES = 10
"""At most, in a folder: source files, `__init__.py`, data and what is built apart."""

Arrows = dict[tuple[str, str], list[str]]
"""From and to, and the places of the imports, as file:line."""


def name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {name(path): path for path in sorted(PACKAGE.rglob("*.py"))}


def imported(path: Path) -> set[tuple[str, int]]:
    """The modules of the package that a file imports, with the lines."""
    package = name(path) if path.name == "__init__.py" else name(path).rpartition(".")[0]
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found += [(alias.name, node.lineno) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                above = package.split(".")[: len(package.split(".")) - node.level + 1]
                base = ".".join([*above, *base.split(".")]).rstrip(".")
            for alias in node.names:
                whole = f"{base}.{alias.name}"
                found.append((whole if whole in MODULES else base, node.lineno))
    return {(module, line) for module, line in found if module in MODULES}


def room(module: str) -> str:
    """The folder of a module; a module at the top of the package is a room of its own."""
    path = MODULES[module]
    return module if path.parent == PACKAGE else name(path.parent / "__init__.py")


@cache
def arrows() -> Arrows:
    found: Arrows = defaultdict(list)
    for module, path in MODULES.items():
        for other, line in sorted(imported(path)):
            if other != module:
                found[module, other].append(f"{path.relative_to(ROOT)}:{line}")
    return dict(found)


def between_rooms(found: Arrows) -> Arrows:
    rooms: Arrows = defaultdict(list)
    for (start, end), places in found.items():
        if room(start) != room(end):
            rooms[room(start), room(end)] += places
    return dict(rooms)


def order(found: Arrows) -> list[str]:
    """All that is named, what is imported before what imports it."""
    graph: dict[str, set[str]] = defaultdict(set)
    for start, end in found:
        graph[start].add(end)
    try:
        return [*TopologicalSorter(graph).static_order()]
    except CycleError as error:
        circle = error.args[1][::-1]  # from the one that imports to the one imported
        steps = pairwise(circle)
        told = [f"{a} -> {b}: {', '.join(found[a, b])}" for a, b in steps]
        pytest.fail("a circle of imports:\n" + "\n".join(told), pytrace=False)


def test_the_reader_of_imports_sees_them() -> None:
    """Against an import that Python itself made, and one of each form."""
    found = arrows()
    assert ("cosim.__main__", "cosim.cli.main") in found
    assert ("cosim.studies.fit.fit", "cosim.mechanics.part") in found
    assert len({start for start, _ in found}) > 100


def test_modules_have_no_circle() -> None:
    order(arrows())


def test_folders_have_no_circle_and_few_floors() -> None:
    """A folder's floor lies above those of all that it imports; a single file has none."""
    found = between_rooms(arrows())
    ways: dict[str, list[str]] = {}
    for start in order(found):
        below = [ways[end] for other, end in found if other == start]
        longest = max(below, key=len, default=[])
        is_folder = start != PACKAGE.name and (ROOT / start.replace(".", "/")).is_dir()
        ways[start] = [start, *longest] if is_folder else longest
    way = max(ways.values(), key=len)
    steps = [f"{a} -> {b}: {', '.join(found.get((a, b), []))}" for a, b in pairwise(way)]
    assert len(way) <= FLOORS, "the longest way down:\n" + "\n".join(steps)


def test_folders_are_small() -> None:
    count: dict[Path, int] = defaultdict(int)
    for path in PACKAGE.rglob("*"):
        folder = path.parent.relative_to(ROOT)
        built = any(part.startswith("_") for part in folder.parts)
        if path.suffix in (".py", ".c", ".h") and path.name != "__init__.py" and not built:
            count[folder] += 1
    large = {str(folder): n for folder, n in count.items() if n > FILES}
    assert not large


def test_circuit_and_mechanics_do_not_know_each_other() -> None:
    """A coupling knows both."""
    sides = {"cosim.circuit", "cosim.mechanics"}
    assert not [
        places
        for (start, end), places in arrows().items()
        if {side for side in sides for name in (start, end) if name.startswith(side)} == sides
    ]


def test_one_class_each_runs_keeps_searches_and_judges() -> None:
    """Evaluator, store, search interface and fidelity policy; and what they stand on is used by
    nothing else, so that no second one grows under another name."""
    trees = {module: ast.parse(path.read_text("utf-8")) for module, path in MODULES.items()}
    classes: dict[str, list[str]] = defaultdict(list)
    searches, interfaces = set(), set()
    for module, tree in trees.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                classes[node.name].append(module)
                methods = {part.name for part in node.body if isinstance(part, ast.FunctionDef)}
                if {"ask", "tell"} <= methods:
                    searches.add(module)
                    if [ast.unparse(base) for base in node.bases] == ["Protocol"]:
                        interfaces.add(f"{module}.{node.name}")
    assert classes["Evaluator"] == ["cosim.evaluate.evaluator"]
    assert classes["Store"] == ["cosim.evaluate.store"]
    assert classes["Fidelity"] == ["cosim.simulation.fidelity"]
    assert interfaces == {"cosim.search.known.Search"}
    assert {module.rpartition(".")[0] for module in searches} == {"cosim.search"}
    alone = {
        "sqlite3": "cosim.evaluate.store",
        "cosim.evaluate.many": "cosim.evaluate.evaluator",
    }
    for package, user in alone.items():
        users = {module for module, tree in trees.items() if package in _names(tree)}
        assert users == {user}, package


def _names(tree: ast.AST) -> set[str]:
    """The modules that a file names in its imports."""
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module)
    return found
