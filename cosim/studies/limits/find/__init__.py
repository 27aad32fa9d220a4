"""The best settings of the knobs for each limit at each value, found and confirmed."""
