"""How circuit and mechanics are solved together: one method a file, behind one protocol.

Where the circuit leads (ngspice), :mod:`cosim.coupling.loop` gives it the back-EMF as a pure
function of time, and the mechanics follow accepted steps only: so nothing in the mechanics must be
undone when the circuit rejects a step.

Between participants that can all repeat a step, :mod:`cosim.coupling.rewind.joint` runs the same
methods, and iterated and event-aware ones; their stability and orders are studied there.
"""
