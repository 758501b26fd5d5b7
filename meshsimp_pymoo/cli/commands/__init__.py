"""The commands, one file each: its name is the command's.

A command is a module with ``HELP`` (what the list of commands says), ``DESCRIPTION``, ``EXAMPLES``, ``add(parser)``,
which adds its arguments, and ``run(args) -> int``, which does the work and returns the exit code. It imports nothing
heavy before it runs, so that ``--help`` is quick. Nothing else has to be told of a new file here.
"""
