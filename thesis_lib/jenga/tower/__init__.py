"""The tower in MuJoCo, and checks that it can be used."""
