"""Where single paths cannot be compared, the statistics of ensembles can."""

from collections.abc import Sequence

import pytest

from benchmarks.chaos import METHODS, SCENE, apart, ensemble, growth
from cosim.studies.accuracy.accuracy import CHAOTIC

pytestmark = pytest.mark.physics


def test_a_chaotic_scene_is_told_from_one_that_is_not() -> None:
    assert growth(SCENE) > CHAOTIC > growth(())


@pytest.mark.slow
@pytest.mark.parametrize(
    "other",
    [("circuit.reltol=3e-6",), METHODS["mean current, 0.2 ms"]],
)
def test_methods_agree_in_what_an_ensemble_leaves_certain(other: Sequence[str]) -> None:
    """And a coil a third weaker does not: the spread does not hide everything."""
    default = ensemble(SCENE, (), 4)
    assert max(default["v_average"]) > min(default["v_average"])
    same = ensemble(SCENE, other, 4)
    weaker = ensemble(SCENE, ("coil.force_factor=0.4",), 4)
    assert apart(default["stick_fraction"], same["stick_fraction"]) < 5.0
    assert apart(default["stick_fraction"], weaker["stick_fraction"]) > 5.0
