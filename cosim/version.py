"""The version of the package; pyproject.toml states it too."""

__version__ = "0.1.0"
