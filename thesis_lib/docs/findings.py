"""Tables of docs/findings.md, from the stored results of the proof."""

from thesis_lib.critique.engines import measured as engines_measured
from thesis_lib.critique.engines import proof as engines_proof
from thesis_lib.critique.proof import direct_fits, measured, next_drops_table
from thesis_lib.critique.proof.by_contact import as_markdown
from thesis_lib.critique.proof.headline import ages_as_markdown
from thesis_lib.critique.proof.headline import as_markdown as headline_as_markdown
from thesis_lib.critique.proof.results import outcomes, recovered
from thesis_lib.critique.proposal import proof as proposals_proof


def headline() -> str:
    """How often the critique is right, by the code that stands beside the page or the code that it names."""
    return headline_as_markdown()


def ages() -> str:
    """How old the tables of the proof are."""
    return ages_as_markdown()


def real_contacts() -> str:
    """How often the critique is right where contacts take time."""
    return as_markdown(outcomes(), recovered(), folded=True).rstrip("\n")


def fits_of_simulated_drops() -> str:
    """Models fitted directly to drops of simulators."""
    return direct_fits.tables()[0]


def fits_of_measured_drops() -> str:
    """Models fitted directly to measured drops."""
    return direct_fits.tables()[1]


def measured_sets() -> str:
    """Critiques of measured sets."""
    return measured.table()


def engines() -> str:
    """Is an engine recognised as the model of its own drops, and right?"""
    return engines_proof.as_markdown()


def proposals() -> str:
    """Is the right term proposed where no named effect fits, and none where nothing is hidden?"""
    return proposals_proof.as_markdown()


def next_experiment() -> str:
    """How many drops the states save that the critique proposes."""
    return next_drops_table.as_markdown()


def models_of_measured_sets() -> str:
    """Laws and engines on both measured sets."""
    return engines_measured.as_markdown()
