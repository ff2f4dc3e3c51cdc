"""Figures of chapter 2: simulated mechanisms, their contact forces and inertias."""
