"""How circuit and mechanics are solved together: one method a file, behind one protocol.

A circuit that leads (ngspice) is joined through :class:`Coupling`: the method is told of each
accepted step and gives the back-EMF as a pure function of time, so that a step that the circuit
rejects needs nothing undone in the mechanics.

Between participants that can all go back to a moment before, methods are written once against
:mod:`cosim.coupling.rewind.joint`: Jacobi, Gauss-Seidel, companion, iterated and event-aware; their
stability and their orders are studied there.
"""
