"""Where single paths cannot be compared, the statistics of ensembles can."""

from cosim.chart.chaos import CHAOTIC, METHODS, SCENE, ensemble, growth


def test_a_chaotic_scene_is_told_from_one_that_is_not() -> None:
    assert growth(SCENE) > CHAOTIC > growth(())


def test_methods_agree_in_what_an_ensemble_leaves_certain() -> None:
    """The default against macro steps; an ensemble of another amplitude does not agree."""
    default = ensemble("default", SCENE, (), 6)
    macro = ensemble("mean current", SCENE, METHODS["mean current, 0.2 ms"], 6)
    weaker = ensemble("weaker", (*SCENE, "coil.force_factor=0.54"), (), 6)
    assert max(default.values["v_average"]) > min(default.values["v_average"])
    assert default.apart(macro, "stick_fraction") < 4.0
    assert default.apart(weaker, "stick_fraction") > 4.0
