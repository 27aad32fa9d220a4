"""The command ``cosim``, a thin user of the library.

Its modules import libraries, and rooms that do, only in the functions that need them.
"""
