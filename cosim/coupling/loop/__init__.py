"""The coupled loop, compiled: ngspice leads, and at its macro points a method is asked.

``loop.h`` has the order of calls.
"""
