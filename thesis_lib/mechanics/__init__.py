"""Rigid-body mechanics of one body in the plane or in space: motions, inertia, contacts, free flight"""
