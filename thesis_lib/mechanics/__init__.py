"""Rigid-body mechanics of one body in the plane or in space: motion, inertia, contacts and free flight."""
