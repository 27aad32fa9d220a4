"""Settings and fixtures of all tests."""

import gc
import json
import os
from collections.abc import Iterator
from contextlib import chdir
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from hypothesis.internal.conjecture import providers

import build_c
from cosim.files import picture
from cosim.simulation import checks
from cosim.toolchain import processes, threads
from cosim.toolchain.libraries import FOLDER

# How long an example takes says something of the machine, not of the code.
ANY_MACHINE = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("test", derandomize=True, database=None, **ANY_MACHINE)
settings.register_profile("fuzz", max_examples=2000, print_blob=True, **ANY_MACHINE)
settings.load_profile("test")  # `make fuzz` asks for the other


@pytest.hookimpl(trylast=True)  # after Hypothesis has chosen the profile
def pytest_configure() -> None:
    # Hypothesis also tries the constants of all modules loaded so far: what it tries would depend
    # on the tests that ran before.
    if settings.get_current_profile_name() == "test":
        providers._get_local_constants = lambda: providers._local_constants


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """One more than there are processors: the tests of processes wait for them."""
    return threads.processors() + 1


@pytest.fixture(scope="session", autouse=True)
def _own_folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Each worker stands in a folder of its own: what goes to `results` by default meets nobody
    else's there, and nothing of the checkout."""
    with chdir(tmp_path_factory.mktemp("here")):
        yield


LONG = (
    "toolchain/test_build_c.py",
    "mechanics/test_sanitizers.py",
    "mechanics/test_built_elsewhere.py",
    "studies/test_limits.py",
    "studies/test_spread.py",
    "studies/test_identify.py",
    "studies/test_fit.py",
    "simulation/test_memory.py",
)
"""What takes seconds in one test begins first: at the end a worker would wait for it."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The tests of a file stay together, with what its fixtures have made."""
    tests = Path(__file__).parent
    ranks = {tests / name: rank for rank, name in enumerate(LONG)}
    items.sort(key=lambda item: ranks.get(item.path, len(LONG)))


def pytest_collection_finish() -> None:
    """What is imported stays until the end: the collector of garbage need not look at it again."""
    gc.freeze()


def pytest_sessionstart() -> None:
    """Refuse to test what was compiled from other sources."""
    try:
        made_of = json.loads((FOLDER / "build.json").read_text())["sources"]
    except OSError:
        made_of = None
    if made_of != build_c.digest():
        pytest.exit("The C sources have changed since they were compiled: run `make setup`.", 2)


@pytest.fixture
def in_place() -> Iterator[None]:
    """Circuits run in the test's own process, in which it can change something."""
    with processes.in_place():
        yield


@pytest.fixture(autouse=True)
def _unchecked(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Quick tests run a scene alone, but those marked "checked": a run's checks make others, in
    processes of their own, which take most of the time of a short run's test."""
    if not any(map(request.node.get_closest_marker, ("checked", "slow"))):
        monkeypatch.setattr(checks, "checked", lambda scene, run, *_: run())
        monkeypatch.setattr(checks, "checked_ports", lambda scene, run, *_: run())


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures are written, but blank: to draw one takes half a second."""
    monkeypatch.setattr(picture.FigureCanvasAgg, "draw", picture.FigureCanvasAgg.get_renderer)


@pytest.fixture(scope="session")
def trials() -> Path:
    """The folder of the ten published trials, which belong to their authors.

    Clone clyako/vertical-vibratory-transport-of-grasped-parts-using-impacts, and let the
    environment variable COSIM_TRIALS name its folder matlab/data.
    """
    folder = os.environ.get("COSIM_TRIALS")
    if not folder:
        pytest.skip("COSIM_TRIALS names no folder with the published trials")
    return Path(folder)
