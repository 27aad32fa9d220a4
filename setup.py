"""Compiles the C when the package is built, and adds the top-level data folders to the wheel.

In a wheel `circuits/` becomes `cosim/_circuits/` and the FMU's table of variables lies in
`cosim/_fmu/`; in a checkout they stay where they are. Everything else stands in pyproject.toml.
"""

import platform
import sys
from pathlib import Path
from typing import ClassVar

from setuptools import Command, Distribution, find_packages, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build import build
from setuptools.errors import CompileError

sys.path.insert(0, str(Path(__file__).parent))  # pip runs this file without its folder there
import build_c


class BuildC(Command):
    """The build step that makes ``cosim/_compiled``, for an editable installation in place."""

    description = "compile the C sources"
    user_options: ClassVar = []

    def initialize_options(self) -> None:
        self.build_lib = None
        self.editable_mode = False

    def finalize_options(self) -> None:
        self.set_undefined_options("build_py", ("build_lib", "build_lib"))

    def run(self) -> None:
        root = build_c.ROOT if self.editable_mode else Path(self.build_lib)
        folder = root / "cosim/_compiled"
        try:
            if not (self.editable_mode and build_c.made(folder)):  # as the Makefile has made it
                build_c.make(folder)
        except build_c.BuildFailed as error:
            raise CompileError(str(error)) from error

    def get_source_files(self) -> list[str]:
        return [path.relative_to(build_c.ROOT).as_posix() for path in build_c.sources()]

    def get_outputs(self) -> list[str]:
        return []

    def get_output_mapping(self) -> dict[str, str]:
        return {}


class PlatformWheel(bdist_wheel):
    """A wheel for one platform and any Python: the libraries do not use Python's interface."""

    def get_tag(self) -> tuple[str, str, str]:
        # A universal Python of macOS; the compiler makes code for this processor only.
        return "py3", "none", super().get_tag()[2].replace("universal2", platform.machine())


class Binary(Distribution):
    def has_ext_modules(self) -> bool:
        return True


build.sub_commands.append(("build_c", None))
setup(
    distclass=Binary,
    cmdclass={"build_c": BuildC, "bdist_wheel": PlatformWheel},
    packages=[*find_packages(include=["cosim", "cosim.*"]), "cosim._circuits", "cosim._fmu"],
    package_dir={"cosim._circuits": "circuits", "cosim._fmu": "fmu"},
)
