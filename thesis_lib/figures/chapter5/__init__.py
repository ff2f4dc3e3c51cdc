"""Figures of chapter 5: the tower, what is learned of it, and who plays how well."""
