"""Do the units, signs and shape of a dataset agree?  Heuristics that must not misfire on real drops."""
