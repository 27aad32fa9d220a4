"""The structures of ``loop.h`` for ports, which says what they hold."""

from cosim.toolchain.libraries import structures

PROBE, OUTPUT, DRIVE = range(3)
"""Kinds of an Origin."""

Group, Origin, Source, Feed, StrangerState, Pulse, Through, PortsState = (
    structures("loop")[name]
    for name in ("Group", "Origin", "Source", "Feed", "Stranger", "Pulse", "Through", "Ports")
)
