"""Figures of chapter 5: the tower, the models learned from it, and the games of the policies."""
