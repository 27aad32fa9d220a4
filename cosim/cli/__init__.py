"""The command ``cosim``: one file a command, one file a chart.

A command is a module in ``simulation/`` or ``studies/``, a chart one in ``charts/``, with a
:class:`cosim.cli.command.Command` called ``COMMAND``. All of them are imported for ``--help``: they
import libraries, and rooms that do, only in the functions that need them.
"""
