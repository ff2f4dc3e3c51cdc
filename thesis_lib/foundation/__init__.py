"""What every room stands on: files, errors, settings, random streams, the terminal, provenance."""
