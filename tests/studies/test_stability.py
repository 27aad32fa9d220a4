"""The stability study: predicted from the linear map, observed with the FMU."""

import pytest

from cosim.studies.stability.stability import (
    DIRECT,
    LONGEST,
    REFERENCE,
    Regime,
    observed,
    predicted,
)

pytestmark = pytest.mark.physics

SLOPE = "EMF's slope, linear current"


@pytest.mark.parametrize(
    ("method", "regime"),
    [
        ("Gauss-Seidel k = 1", Regime(DIRECT, "saturated")),
        *(
            pytest.param(*one, marks=pytest.mark.slow)
            for one in (
                ("Jacobi k = 0", Regime(DIRECT, "saturated")),
                (SLOPE, Regime(REFERENCE, "saturated", slips=True)),
                (SLOPE, Regime(REFERENCE, "saturated", cut="coil in mechanics")),
            )
        ),
    ],
)
def test_prediction_and_observation_agree(method: str, regime: Regime) -> None:
    expected = predicted(method, regime)
    assert observed(method, regime, expected) == pytest.approx(expected, rel=0.1)


def test_explicit_coupling_of_the_direct_drive_fails_at_a_millisecond_and_the_companion_not() -> (
    None
):
    regime = Regime(DIRECT, "saturated")
    assert predicted("Jacobi k = 0", regime) < 1e-3
    explicit = predicted("Gauss-Seidel k = 1", regime)
    assert explicit < 1.5e-3
    assert observed("companion", regime, LONGEST) >= 10.0 * explicit
