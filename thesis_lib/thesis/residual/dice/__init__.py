"""The study of thrown dice (thesis 4.4)."""
