"""Samples of a recording put right before impacts are sought: arrival stamps, copied pictures, rests, pieces."""
