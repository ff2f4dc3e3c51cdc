"""From trajectories to impacts with covariance: detection, arcs, noise, quality."""
