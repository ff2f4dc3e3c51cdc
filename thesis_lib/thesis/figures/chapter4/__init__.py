"""Figures of chapter 4: learned contact models and thrown dice."""
