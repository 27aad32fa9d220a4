"""The command ``cosim``: one file a command, one file a chart.

Each module declares its :class:`cosim.cli.command.Command` as ``COMMAND``, and imports libraries,
and rooms that do, only in the functions that need them: ``--help`` imports all modules.
"""
