"""Adds the top-level data folders to the wheel; everything else stands in pyproject.toml.

In a wheel `circuits/` and `fmu/` become `cosim/_circuits/` and `cosim/_fmu/`; in a checkout
they stay where they are.
"""

from setuptools import find_packages, setup

setup(
    packages=[*find_packages(include=["cosim", "cosim.*"]), "cosim._circuits", "cosim._fmu"],
    package_dir={"cosim._circuits": "circuits", "cosim._fmu": "fmu"},
)
