"""Sources of datasets: a rig's own logs, and published datasets."""
