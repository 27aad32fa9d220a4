"""The structures of ``loop.h`` for ports, which says what they hold."""

from cosim.toolchain.libraries import structures

Group, Origin, Source, Feed, StrangerState, Pulse, PortsState = (
    structures("loop")[name]
    for name in ("Group", "Origin", "Source", "Feed", "Stranger", "Pulse", "Ports")
)
