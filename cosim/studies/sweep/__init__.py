"""Sweeps: one scene at many settings of its keys."""

from cosim.studies.sweep.run import sweep

__all__ = ["sweep"]
