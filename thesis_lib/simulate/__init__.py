"""Planar bodies simulated by time stepping, with contact impulses from a linear complementarity problem."""
