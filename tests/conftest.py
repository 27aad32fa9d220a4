"""Settings and fixtures of all tests."""

import json

import pytest

import build_c
from cosim.toolchain.libraries import FOLDER


def pytest_sessionstart() -> None:
    """Refuse to test what was compiled from other sources."""
    try:
        made_of = json.loads((FOLDER / "build.json").read_text())["sources"]
    except OSError:
        made_of = None
    if made_of != build_c.digest():
        pytest.exit("The C sources have changed since they were compiled: run `make setup`.", 2)
