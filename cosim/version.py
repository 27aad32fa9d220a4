"""The version of the package; pyproject.toml states it too."""

__version__ = "1.0.0"
