"""Time stepping with contact impulses from a linear complementarity problem (thesis 2.3.1)."""
