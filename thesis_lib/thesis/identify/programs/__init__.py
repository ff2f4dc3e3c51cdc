"""The mathematical programs of identification (thesis eqs. 2.12 to 2.14)."""
