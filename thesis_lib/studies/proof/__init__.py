"""The proof: the critique on drops whose hidden cause is known.  `python -m thesis_lib.studies.proof --help`."""
