"""The robot beside the tower: pushing, pulling, placing and sensing."""
