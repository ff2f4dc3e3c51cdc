"""The robot at the tower: pushing, pulling, placing and sensing."""
