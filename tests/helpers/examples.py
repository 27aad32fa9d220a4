"""How many examples a random test tries."""

from hypothesis import settings


def examples(number: int, at_least: int = 0) -> settings:
    """As many as given in `make test`, where they are the same each time, and more in `make fuzz`.

    The profiles of ``tests/conftest.py`` say how many more; in `make fuzz` ``at_least`` so many.
    """
    factor = settings().max_examples / 100
    return settings(max_examples=max(round(number * factor), at_least if factor > 1 else 0))
