"""Base parameters of a motion and their identifiability (thesis 2.3.2 step 1, 2.3.3)."""
