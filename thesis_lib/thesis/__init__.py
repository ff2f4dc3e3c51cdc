"""The thesis on the library: chapters 2 to 5, their figures, records, claims and pages; runs from a clone."""
