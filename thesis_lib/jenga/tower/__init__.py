"""The tower in MuJoCo, and whether it may be used."""
