"""Standard errors, intervals and robust spreads, and their wording in sentences."""
