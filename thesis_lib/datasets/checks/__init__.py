"""Do units, signs and shape of a dataset fit together?  Heuristics that must not misfire on real drops."""
