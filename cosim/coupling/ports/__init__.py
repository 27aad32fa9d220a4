"""Circuits and FMUs of the user's own, joined by the ports of a scene; the calls during a run are
those of ``cosim/coupling/loop/ports.c``.
"""
