"""The pages of docs/reference/ say what the program's tables say, and these what a run has."""

import pytest

import cosim
from cosim.waveforms.quantities import SUMMARY
from docs.programs.reference import FOLDER, PAGES, written

BRIEF = {"run.duration": 0.06, "run.settle": 0.03}
KINDS = {"motion", "motion_periods", "motion_settled", "v_average_answers", "v_average_range"}
"""For which these runs have too few periods."""
OTHERS = {"spread", "v_average_other_starts", *KINDS}
"""Entries that options of `cosim run` add to the file, and those of longer runs."""


@pytest.mark.parametrize("name", PAGES)
def test_page_is_up_to_date(name: str) -> None:
    text = (FOLDER / f"{name}.md").read_text(encoding="utf-8")
    assert text == written(name), "run `make docs`"


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
