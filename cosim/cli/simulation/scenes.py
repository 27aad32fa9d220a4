"""``cosim scenes``."""

from argparse import Namespace

from cosim.cli.command import Command


def _run(arguments: Namespace) -> None:
    from cosim.scene import list_scenes

    found = list_scenes()
    width = max(len(name) for name, _ in found)
    for name, description in found:
        print(f"{name:<{width}}  {description}")


COMMAND = Command("scenes", "list the built-in scenes", _run)
