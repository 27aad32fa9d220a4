"""The gallery of results: it names all that is there, and the commands are commands."""

import json
import re
import shlex
import tomllib
from pathlib import Path

import pytest

from benchmarks import stale
from cosim.cli.main import _parser

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "results"
GALLERY = (RESULTS / "README.md").read_text(encoding="utf-8")
COMMANDS = sorted(set(re.findall(r"`cosim (.+?)`", GALLERY)))


def test_every_file_is_in_the_gallery_and_every_link_leads_to_one() -> None:
    kept = re.findall(r"^!/results/\*(\.\w+)$", (ROOT / ".gitignore").read_text("utf-8"), re.M)
    there = {path.name for path in RESULTS.iterdir() if path.suffix in kept} - {"README.md"}
    links = {name for name in re.findall(r"\]\(([^)#]+)", GALLERY) if not name.startswith("../")}
    assert len(there) > 20
    assert links == there


@pytest.mark.parametrize("line", COMMANDS)
def test_its_commands_can_be_given(line: str) -> None:
    words = shlex.split(line.replace("TRIALS_DIR", "trials"))
    assert callable(_parser(words).parse_args(words).call)


def test_each_row_has_a_command() -> None:
    rows = [row.split("|")[1:-1] for row in GALLERY.splitlines() if row.startswith("| [")]
    assert len(rows) > 12
    assert all(len(row) == 3 and re.search(r"`(cosim|make) |the same", row[2]) for row in rows)


def test_the_readmes_answer_is_what_the_data_say() -> None:
    """Each point of it is a sentence that the study has made of its numbers."""
    section = re.split(r"^## ", (ROOT / "README.md").read_text(encoding="utf-8"), flags=re.M)
    (answer,) = [text for text in section if text.startswith("The answer")]
    points = re.findall(r"^- (.+(?:\n  .+)*)", answer, flags=re.M)
    pages = (RESULTS / name for name in ("limits.md", "measure.md"))
    said = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    assert len(points) >= 6
    for point in points:
        assert re.sub(r"\s+", " ", point) in said, point


def test_the_citation_is_of_this_version() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")


def test_results_that_another_core_has_made_are_told(tmp_path: Path) -> None:
    source, results = tmp_path / "fmu" / "src" / "a.c", tmp_path / "results"
    for folder in (source.parent, results, tmp_path / stale.MADE.parent):
        folder.mkdir(parents=True)
    source.write_text("int a;", encoding="utf-8")
    for name in ("old.csv", "new.csv", "foreign.png"):
        (results / name).write_text("", encoding="utf-8")
    stale.made(["results/old.csv"], tmp_path)
    then = stale.core(tmp_path)
    assert stale.stale(tmp_path) == {"": ["foreign.png", "new.csv"]}
    source.write_text("int b;", encoding="utf-8")
    stale.made([str(results / "new.csv")], tmp_path)
    assert stale.stale(tmp_path) == {"": ["foreign.png"], then: ["old.csv"]}


def test_the_core_is_where_it_is_looked_for() -> None:
    assert all((ROOT / folder).is_dir() for folder in stale.CORE)
    assert set(json.loads((ROOT / stale.MADE).read_text())) >= {
        p.name for p in RESULTS.glob("*.csv")
    }
