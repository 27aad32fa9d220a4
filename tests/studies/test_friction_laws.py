"""Creep of the friction laws against closed forms."""

from math import atanh

import pytest

from cosim.scene import load
from cosim.studies.accuracy.friction import creep

pytestmark = pytest.mark.physics


def test_creep_of_a_held_part() -> None:
    """Held without vibration tanh slips at v0 atanh(m g / (mu F_n)), which vibration changes
    little; all laws come to the exact stop as their width goes to zero."""
    rows = {(row["law"], row["width"]): row for row in creep()}
    paper = load("paper")
    share = paper.mechanics.part_mass * paper.mechanics.gravity
    share /= paper.friction.mu_s * paper.friction.normal_force
    still = 1e6 * 1e-5 * atanh(share)
    assert rows["tanh", "1e-05 m/s"]["creep [um/s]"] == pytest.approx(still, rel=0.1)
    assert rows["Karnopp", "1e-05 m/s"]["creep [um/s]"] == pytest.approx(10.0, rel=1e-3)
    for law, widths in (("tanh", ("0.001", "1e-06")), ("Karnopp", ("0.001", "1e-05"))):
        wide, narrow = (rows[law, f"{w} m/s"]["error of the stop [um]"] for w in widths)
        assert abs(narrow) < abs(wide) / 50.0
    assert rows["Coulomb, exact", "-"]["creep [um/s]"] == 0.0
