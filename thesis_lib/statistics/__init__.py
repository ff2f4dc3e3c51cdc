"""Standard errors, intervals and robust spreads, and numbers as they stand in sentences."""
