"""The proof: the critique applied to drops with a known hidden cause.  `python -m thesis_lib.studies.proof --help`."""
