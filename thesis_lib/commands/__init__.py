"""The command line: each command of `thesis_lib COMMAND` in a module of its own."""
