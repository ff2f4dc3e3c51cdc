"""Foundation of every room: files, errors, settings, random streams, the terminal, provenance."""
