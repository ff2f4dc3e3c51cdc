"""The command line: a module for each command of `thesis_lib COMMAND`."""
