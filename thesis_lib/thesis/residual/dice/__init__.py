"""Study of thrown dice (thesis 4.4)."""
