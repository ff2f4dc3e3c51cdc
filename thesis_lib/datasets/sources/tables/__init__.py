"""Tables of a rig's own logs, and the options that describe them and the rig."""
