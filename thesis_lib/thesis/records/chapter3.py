"""Functions for the findings of chapter 3, and the laws and limits that they name."""

from thesis_lib.statistics.wording import ends, estimate, side
from thesis_lib.thesis.records.rows import PUBLISHED, DataFrame, Series

THESIS_RANGE = (0.355, 0.458)  # Table 3.2, smallest and largest fraction
CONVERGED = 100  # section 3.4: the parameters have converged from "about" this number of impacts
NEAR = 1.5  # more than this many times CONVERGED is no longer "about" it
INCLINED_PLANE = 0.3  # μ of PLA on aluminium, section 3.4
STUDIED = "anitescu_potra_newton"  # the law of figures 3-10 and 3-11
MU_ZERO = 1e-3  # an individual μ below this counts as zero, as in statements.csv
VISCOUS = "mirtich"  # its published μ, in s/m, is not a coefficient of friction
MAPPED = "anitescu_potra_poisson"  # the law of figure 3-9


def variants(coverage: DataFrame) -> tuple[Series, Series]:
    """Shares of the admissible set that the laws cover as published and as defined, by law."""
    share = coverage.set_index("law")["share"]
    is_published = share.index.str.endswith(PUBLISHED)
    as_defined, differing = share[~is_published], share[is_published].rename(lambda law: law.removesuffix(PUBLISHED))
    # a law whose published code matches its definition has one row, used for both
    return differing.combine_first(as_defined), as_defined


def left_over_right(figure: DataFrame) -> tuple[float, float] | None:
    """Ratio of mean errors left and right of zero tangential momentum, with standard error; None if a side has < 2."""
    impacts = figure[figure["series"] == "impact"]
    sides = [impacts.loc[impacts["momentum_t"] * sign > 0, "error"] for sign in (-1, 1)]
    if min(map(len, sides)) < 2:
        return None
    (left, left_std), (right, right_std) = (
        (float(errors.mean()), float(errors.std() / len(errors) ** 0.5)) for errors in sides
    )
    return left / right, ((left_std / right) ** 2 + (left * right_std / right**2) ** 2) ** 0.5


def ratio(value: float, std: float, other: str) -> str:
    """Phrase with a ratio, its interval, and whether it differs significantly from 1."""
    doubt = side(*ends(value, std), 1.0, ("", ", not significantly different", ""))
    return f"{estimate(value, std)} times that {other}{doubt}"
