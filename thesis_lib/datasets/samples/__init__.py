"""Corrections of recorded samples before impacts are detected: arrival stamps, copied pictures, rests, pieces."""
