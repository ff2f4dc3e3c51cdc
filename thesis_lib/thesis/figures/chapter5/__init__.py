"""Figures of chapter 5: the tower, the models learned from it, and how well each policy plays."""
