"""Foundation of all other packages: files, errors, settings, random streams, the terminal, provenance."""

SEED = 20190906  # default of configuration, command line and library, so that all three give the same numbers
