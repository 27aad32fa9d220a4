"""The electrical participant: the netlist in ngspice, and what is known about it."""
