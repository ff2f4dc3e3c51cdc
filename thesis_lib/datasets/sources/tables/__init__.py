"""Tables of a rig's own logs, and what options say of them and of the rig."""
