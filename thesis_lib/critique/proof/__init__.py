"""The proof: the critique on drops whose hidden cause is known.  `python -m thesis_lib.critique.proof --help`."""
