"""Every block of code in README and docs runs, prints what the page says, and every link leads on.

A page is a program: its blocks run in order in one folder, as :mod:`docs.programs.pages` has it.
"""

import ast
import contextlib
import functools
import os
import re
import shutil
import subprocess
import sys
from io import StringIO
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

from docs.programs.pages import Block, blocks

REPOSITORY = Path(__file__).parents[2]
DOCS = REPOSITORY / "docs"
MADE = REPOSITORY / "docs" / "reference"
PAGES = [
    *(REPOSITORY / name for name in ("README.md", "circuits/README.md", "fmu/README.md")),
    *sorted(page for page in (REPOSITORY / "docs").rglob("*.md")),
]
NUMBER = re.compile(r"[-+]?\d+(?:\.(\d+))?(?:e[-+]?\d+)?")
AGREEMENT = 5e-3
"""Of a number on a page and the one that is printed, besides a unit in the last place: libraries
and processors differ."""

COMMANDS = "cosim|make|pip|python|ngspice|git"

LINK = re.compile(r"\]\((?!\w+:)([^)#\s]*)(?:#([^)\s]+))?\)")
"""Of a link that is not one to elsewhere: file and heading."""


def name(page: Path) -> str:
    return page.relative_to(REPOSITORY).as_posix()


RUNS = {name(page): blocks(page.read_text(encoding="utf-8")) for page in PAGES}


def quick(block: Block) -> bool:
    return block.note != "slow"


def can_run(block: Block) -> bool:
    needs = block.note.removeprefix("needs ")
    missing = needs != block.note and shutil.which(needs) is None
    return block.runs and not block.note.startswith("not run") and not missing


def printed(block: Block, names: dict[str, object]) -> str:
    """Run a block; what it prints."""
    if block.title:
        Path(block.title).write_text(block.text, encoding="utf-8")
        return ""
    if block.language == "python":
        out = StringIO()
        with contextlib.redirect_stdout(out):
            exec(compile(block.text, f"<line {block.line}>", "exec"), names)
        plt.close("all")
        return out.getvalue()
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", block.text],
        env={**os.environ, "PATH": path, "PYTHONPATH": str(REPOSITORY)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert done.returncode == 0, f"line {block.line}:\n{done.stdout}"
    return done.stdout


def alike(said: str, found: str) -> bool:
    """Whether two lines have the same words, and numbers that agree as far as they are told. A line
    of the page that ends with “…” is the beginning of one."""
    if said.endswith("…"):
        words = said.removesuffix("…").split()
        said, found = " ".join(words), " ".join(found.split()[: len(words)])
    if NUMBER.sub("#", said).split() != NUMBER.sub("#", found).split():
        return False
    for one, other in zip(NUMBER.finditer(said), NUMBER.finditer(found), strict=True):
        last = 10.0 ** -len(one[1] or "")
        if abs(float(one[0]) - float(other[0])) > last + AGREEMENT * abs(float(other[0])):
            return False
    return True


def check(said: str, found: str, block: Block) -> None:
    lines = iter(found.splitlines())
    for line in filter(str.strip, said.splitlines()):
        assert any(alike(line, other) for other in lines), (
            f"line {block.line}: “{line}” is not, or not here, in what is printed:\n{found}"
        )


def run(page: str, folder: Path, slow: bool) -> None:
    for part in ("circuits", "fmu"):
        shutil.copytree(REPOSITORY / part, folder / part)
    names: dict[str, object] = {"__name__": "__main__"}
    out: str | None = None
    for block in RUNS[page]:
        if can_run(block) and (slow or quick(block)):
            out = printed(block, names)
        elif block.language == "text" and out is not None:
            check(block.text, out, block)
            out = None
        else:
            out = None


def pages(slow: bool) -> list[str]:
    """Those with something to run, or with something slow."""
    return [
        page
        for page, found in RUNS.items()
        if any(can_run(block) and (not slow or not quick(block)) for block in found)
    ]


FIRST = "README.md", "docs/tutorials/"
"""What a newcomer reads: the beginnings of the pages whose quick blocks are run by `make test`."""


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, marks=[] if page.startswith(FIRST) else [pytest.mark.slow])
        for page in pages(slow=False)
    ],
)
@pytest.mark.filterwarnings("ignore")
def test_page_runs(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All but what is marked as slow."""
    monkeypatch.chdir(tmp_path)
    run(page, tmp_path, slow=False)


@pytest.mark.slow
@pytest.mark.timeout(1800)  # one page identifies a rig
@pytest.mark.parametrize("page", pages(slow=True))
@pytest.mark.filterwarnings("ignore")
def test_whole_page_runs(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    run(page, tmp_path, slow=True)


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_blocks_say_what_they_are(page: Path) -> None:
    """No command hides from the tests: in a fence of a language that nothing runs, or without one;
    and what is not run has its reason."""
    text = page.read_text(encoding="utf-8")
    found = RUNS[name(page)]
    assert text.count("```") == 2 * len(found), "a fence has no language, or no end"
    hidden = re.search(rf"^    ({COMMANDS}) .*", text, re.MULTILINE)
    inside = hidden and any(block.start < hidden.start() < block.end for block in found)
    assert not hidden or inside, f"a command outside of a fence: {hidden[0]}"
    for block in found:
        assert block.language in {"c", "python", "sh", "text", "toml", "spice", "csv"}, block.line
        known = block.note in ("", "slow") or re.match(r"needs \w+$|not run: \w.*\w", block.note)
        assert known or not block.runs, f"line {block.line}: {block.note}"
        if block.language in ("text", "spice", "csv") and not block.title:
            hidden = re.search(rf"^\s*\$? *({COMMANDS}) ", block.text, re.MULTILINE)
            assert not hidden, f"line {block.line}: a command in a block that is not run"


@functools.cache
def outside() -> tuple[str, ...]:
    """What the site takes from beside docs/; the module that says it needs MkDocs."""
    text = (DOCS / "programs" / "hooks.py").read_text(encoding="utf-8")
    found: tuple[str, ...] = ast.literal_eval(
        text.partition("\nOUTSIDE = ")[2].partition('\n"""')[0]
    )
    return found


def headings(page: Path) -> set[str]:
    """The anchors of a page."""
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    words = [re.sub(r"[`*\[\]]", "", head) for head in re.findall(r"^#+ (.*)$", text, re.MULTILINE)]
    return {re.sub(r"[^\w\- ]", "", head).strip().lower().replace(" ", "-") for head in words}


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_somewhere(page: Path) -> None:
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for file, heading in LINK.findall(text):
        target = (page.parent / file).resolve() if file else page
        assert target.exists(), f"{name(page)} links to {file}"
        if DOCS in page.parents and DOCS not in (target, *target.parents) and target.is_file():
            taken = any(target in REPOSITORY.glob(pattern) for pattern in outside())
            assert taken, f"{name(page)} links to {file}, which the site does not have"
        if heading and target.suffix == ".md":
            assert heading in headings(target), f"{name(page)} links to {file}#{heading}"
