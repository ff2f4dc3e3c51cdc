"""The robot at the tower: pushing, pulling, placing, and what it senses."""
