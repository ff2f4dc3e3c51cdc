"""Free flights between impacts: lines, arcs and parabolas through their samples, noise, air, and rounded corners."""
