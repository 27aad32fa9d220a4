"""The charts of ``cosim chart``."""
