"""Creep of the friction laws against closed forms."""

from math import atanh

import pytest

from benchmarks.friction import COULOMB, CREEP, creep
from cosim.scene import load

pytestmark = pytest.mark.physics


def test_creep_of_a_held_part() -> None:
    """Held without vibration tanh slips at v0 atanh(m g / (mu F_n)), which vibration changes
    little; all laws come to the exact stop as their width goes to zero."""
    rows = {(row["law"], row["width"]): row for row in creep()}
    rig = load("reference")
    share = rig.mechanics.part_mass * rig.mechanics.gravity
    share /= rig.friction.mu_s * rig.friction.normal_force
    still = 1e6 * 1e-5 * atanh(share)
    assert rows["tanh", "10 µm/s"][CREEP] == pytest.approx(still, rel=0.1)
    assert rows["Karnopp", "10 µm/s"][CREEP] == pytest.approx(10.0, rel=1e-3)
    for law in ("tanh", "Karnopp"):
        wide, narrow = (rows[law, f"{w} µm/s"]["error of the stop [um]"] for w in (1000, 10))
        assert abs(narrow) < abs(wide) / 50.0
    assert rows[COULOMB, ""][CREEP] == 0.0
