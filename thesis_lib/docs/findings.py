"""Tables of docs/findings.md, from the stored results of the proof."""

from thesis_lib.critique.proof import direct_fits, measured
from thesis_lib.critique.proof.by_contact import as_markdown
from thesis_lib.critique.proof.results import outcomes, recovered


def real_contacts() -> str:
    """How often the critique is right where contacts take time."""
    return as_markdown(outcomes(), recovered(), folded=True).rstrip("\n")


def fits_of_simulated_drops() -> str:
    """Models fitted directly to drops of simulators."""
    return _fits(0)


def fits_of_measured_drops() -> str:
    """Models fitted directly to measured drops."""
    return _fits(1)


def measured_sets() -> str:
    """Critiques of measured sets."""
    return "\n".join(measured.table())


def _fits(which: int) -> str:
    return "\n".join(direct_fits.table()).split("\n\n")[which]
