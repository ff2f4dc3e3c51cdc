"""Time stepping with contact impulses from linear complementarity problems (thesis 2.3.1)."""
