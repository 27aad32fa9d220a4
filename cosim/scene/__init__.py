"""Scenes: what a run simulates, read from TOML and checked.

>>> scene = load("paper", ["run.duration=0.5", "mechanics.contact=rigid"])
>>> scene.drive.frequency
20.0
"""

from cosim.scene.describe import KEYS, Key
from cosim.scene.loading import Overrides, changed, list_scenes, load, to_link
from cosim.scene.model import Scene, to_toml
from cosim.scene.rungs import RUNGS

__all__ = [
    "KEYS", "RUNGS", "Key", "Overrides", "Scene", "changed", "list_scenes", "load", "to_link",
    "to_toml",
]  # fmt: skip
