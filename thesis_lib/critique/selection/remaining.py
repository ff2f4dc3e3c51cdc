"""What a critique leaves unexplained, and whether that matters."""

from dataclasses import dataclass

from thesis_lib.critique.selection.settings import SearchSettings


@dataclass(frozen=True)
class Remaining:
    """Structure left in the residuals of the final model.

    Attributes:
        p_value: of the structure, under noise alone.
        error_before: of the residual; error_after: of noise or the unlearnable part alone; in the world's unit.
        depends_on: names of the states on which it depends, by relevance.
    """

    p_value: float
    error_before: float
    error_after: float
    depends_on: tuple[str, ...]

    def is_structured(self, settings: SearchSettings, floor: float) -> bool:
        """Whether it is significant and matters; `floor`: error of noise alone, in the world's unit."""
        return self.p_value <= settings.alpha and settings.matters(self.error_before, self.error_after, floor)
