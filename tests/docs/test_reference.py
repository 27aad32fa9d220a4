"""The pages of docs/reference/ say what the program's tables say, and these what a run has."""

from pathlib import Path

import pytest

import cosim
from cosim.waveforms.quantities import SUMMARY
from docs.programs.reference import files

BRIEF = {"run.duration": 0.06, "run.settle": 0.03}
KINDS = {
    "motion",
    "motion_periods",
    "motion_settled",
    "v_average_settled",
    "v_average_answers",
    "v_average_range",
}
"""For which these runs have too few periods."""
OTHERS = {"spread", "steps_repeated", "v_average_other_starts", *KINDS}
"""Entries that options of `cosim run` add to the file, and those of longer runs and of own FMUs."""


@pytest.mark.parametrize(("path", "text"), files().items(), ids=[path.name for path in files()])
def test_page_is_up_to_date(path: Path, text: str) -> None:
    assert path.read_text(encoding="utf-8") == text, "run `make docs`"


@pytest.mark.checked
@pytest.mark.filterwarnings("ignore")
def test_every_number_of_a_run_has_its_meaning() -> None:
    """On every rung that has numbers of its own."""
    runs = [
        ("reference", {}),
        ("reference", {"circuit.model": "auto"}),
        ("reference", {"coupling.method": "auto"}),
        ("reference", {"circuit.model": "full"}),
        ("two-surfaces", {}),
        ("optimal", {}),
    ]
    found = {"run"}
    for scene, changes in runs:
        found |= cosim.run(scene, changes | BRIEF).summary.keys()
    assert found == SUMMARY.keys() - OTHERS
