"""FMUs for others: of a netlist, of one's own C, and a whole machine as an .ssp."""
