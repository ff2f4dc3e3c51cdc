"""What a motion depends on and what of it can be identified (thesis 2.3.2 step 1, 2.3.3)."""
