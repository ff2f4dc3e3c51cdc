"""Command line: the commands of `thesis-lib COMMAND`."""
