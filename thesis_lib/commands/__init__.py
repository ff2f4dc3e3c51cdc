"""The command line: what each command of `thesis_lib COMMAND` does."""
