"""How many examples a random test tries."""

from hypothesis import settings


def examples(number: int) -> settings:
    """As many as given in `make test`, where they are the same each time, and more in `make fuzz`.

    The profiles of ``tests/conftest.py`` say how many more.
    """
    return settings(max_examples=number * settings().max_examples // 100)
