"""Contact forces of the rimless wheel (thesis 2.4, figure 2-11)."""
