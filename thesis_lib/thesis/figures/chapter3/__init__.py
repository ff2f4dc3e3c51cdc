"""Figures of chapter 3: contact space, impact laws and their errors."""
