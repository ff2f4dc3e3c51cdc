"""Where datasets come from: a rig's own logs, and the published sets."""
