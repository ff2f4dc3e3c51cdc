"""Force at impact and m/I from measured impacts (thesis 2.5)."""
