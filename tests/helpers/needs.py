"""Marks of tests that need what a machine may lack."""

import os
import shutil

import pytest

from tests.helpers.ngspice_alone import LIBRARY

ngspice_library = pytest.mark.skipif(
    LIBRARY is None, reason="the ngspice shared library is not installed"
)
ngspice_program = pytest.mark.skipif(
    shutil.which("ngspice") is None, reason="the ngspice program is not installed"
)
posix = pytest.mark.skipif(os.name != "posix", reason="needs POSIX: signals, pipes, modes of files")
