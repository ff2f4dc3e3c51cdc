"""Are the units, signs and shape of a dataset consistent?  Heuristics that must not misfire on real drops."""
