"""The identification programs (thesis eqs. 2.12 to 2.14)."""
