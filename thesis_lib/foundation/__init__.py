"""Foundation of every room: files, errors, settings, random streams, the terminal, provenance."""

SEED = 20190906  # of configuration, command line and library, where no other is given: all three give the same numbers
