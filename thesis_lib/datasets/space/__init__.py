"""Motions in space: the plane in which a body moves, its free flights, and the drops of a long recording."""
