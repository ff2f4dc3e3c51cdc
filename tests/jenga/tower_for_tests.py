"""One settled tower, shared by the tests of a module and restored for each."""

from thesis_lib.jenga.tower.tower import Snapshot, Tower

SEED = 0
FREE_BLOCK, STUCK_BLOCK = 4, 16  # of that tower, found by a scan; the tests say what they show


class Settled:
    """Builds the tower once."""

    tower: Tower | None = None
    snapshot: Snapshot | None = None

    @classmethod
    def get(cls) -> Tower:
        if cls.tower is None:
            cls.tower = Tower(SEED).settle()
            cls.snapshot = cls.tower.save()
        cls.tower.load(cls.snapshot)
        cls.tower.iterations_needed = 0
        return cls.tower
