"""Chapters 2 to 5 of the thesis, built on the library: figures, records, claims and pages; runs from a clone."""
