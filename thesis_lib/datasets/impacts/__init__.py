"""From trajectories to impacts with covariance: detection, episodes, quality, energy."""
