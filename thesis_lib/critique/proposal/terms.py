"""The terms that may be proposed: products of dimensionless variables of a contact, and the quantities they change.

A term is a target with one or two factors φ.  With a the only parameter, a pure number,

    epsilon     ε ← clip(ε (1 + a φ), 0, 1)          mu         μ ← max(μ (1 + a φ), 0)
    direction   dc_t = a φ dp beside friction        couple     dτ = a φ k dp

so units are right for every product.  ε depends on the state before the impact.  The other three act along the path of
the impact, p being the normal impulse: v_t and ω in their φ are those of the moment
(`thesis_lib/effects/driven_path.py`).  Factors are even or odd under a mirror that exchanges left and right, and
products of two are used only if the law then holds in a mirror, too: even for ε and μ, odd for the other two.

| on paper  | in code | unit | shape | meaning                                                                |
|-----------|---------|------|-------|------------------------------------------------------------------------|
| v_t, v_n  | `v_t`, `v_n` | m/s | (n,) | velocity of the contact point before the impact                      |
| v         | `v`     | m/s  | (n,)  | its speed, √(v_t² + v_n²)                                              |
| r_x, k    | `r_x`, `k` | m | (n,), () | contact point ahead of the centre of mass; radius of gyration        |
| β         | `beta`  | rad  | (n,)  | place on the body, polar angle of the contact point in the body's axes |
| x         | `x`     | m    | (n,)  | place that is touched, from the reference of the rig                   |
| i         | `trial` | 1    | (n,)  | number of the release, from that of the reference                      |
| v_0       | 1 m/s   |      |       | fixed scale, as of the library's own effects of speed                  |

These variables, rather than arbitrary powers, describe a contact of a planar body before an impact.  The sparse
regression of physical laws from a library of products follows Brunton, Proctor and Kutz 2016
(doi:10.1073/pnas.1517384113); dimensionless groups keep the library small, as in Bakarji et al. 2022
(doi:10.1038/s43588-022-00355-5).
"""

import ast
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

Target = Literal["epsilon", "mu", "direction", "couple"]
EVEN: tuple[Target, ...] = ("epsilon", "mu")  # the same in a mirror; the others change their sign
TARGETS: dict[Target, str] = {
    "epsilon": "restitution",
    "mu": "friction",
    "direction": "sideways impulse",
    "couple": "couple",
}


OF_SPIN = frozenset({"v_t", "v", "omega", "beta", "r_x"})  # variables that are unknown without the angle


@dataclass(frozen=True)
class Factor:
    """One dimensionless variable.

    Attributes:
        name: in names of effects; symbol: in equations; words: in sentences.
        code: in Python, with the variables in the module's table.
        odd: whether it changes its sign in a mirror.
        group: subject of the factor; a product has factors of two groups.
        single: whether it is never part of a product.
    """

    name: str
    symbol: str
    words: str
    code: str
    odd: bool
    group: str
    single: bool = False


FACTORS = (
    Factor("obliquity", "|v_t|/v", "obliqueness of the impact", "np.abs(v_t) / v", False, "incidence"),
    Factor("steepness", "|v_n|/v", "steepness of the impact", "np.abs(v_n) / v", False, "incidence"),
    Factor("slip", "v_t/v", "direction of the slip", "v_t / v", True, "incidence"),
    Factor("slip_speed", "|v_t|/v_0", "speed of the slip", "np.abs(v_t)", False, "speed"),
    Factor("squared_slip_speed", "(v_t/v_0)²", "square of the speed of the slip", "v_t**2", False, "speed", True),
    Factor("approach_speed", "|v_n|/v_0", "speed of the approach", "np.abs(v_n)", False, "speed"),
    Factor("spin", "|ω|k/v", "spin", "np.abs(omega) * k / v", False, "spin"),
    Factor("squared_spin", "(ωk/v)²", "square of the spin", "(omega * k / v) ** 2", False, "spin", True),
    Factor("turning", "ωk/v", "turning", "omega * k / v", True, "spin"),
    Factor("lever", "r_x/k", "lever of the contact point", "r_x / k", True, "body"),
    Factor("arm", "|r_x|/k", "length of that lever", "np.abs(r_x) / k", False, "body"),
    Factor("squared_lever", "(r_x/k)²", "square of that lever", "(r_x / k) ** 2", False, "body", True),
    Factor("end", "cos β", "end of the body", "np.cos(beta)", True, "body", True),
    Factor("side", "sin β", "side of the body", "np.sin(beta)", False, "body", True),
    Factor("ends_and_sides", "cos 2β", "place on the body, twice around", "np.cos(2.0 * beta)", False, "body"),
    Factor("diagonals", "sin 2β", "diagonal of the body", "np.sin(2.0 * beta)", True, "body"),
    Factor("thirds", "sin 3β", "place on the body, three times around", "np.sin(3.0 * beta)", False, "body", True),
    Factor("odd_thirds", "cos 3β", "left against right, three times around", "np.cos(3.0 * beta)", True, "body", True),
    Factor("quarters", "cos 4β", "place on the body, four times around", "np.cos(4.0 * beta)", False, "body", True),
    Factor("odd_quarters", "sin 4β", "left against right, four times around", "np.sin(4.0 * beta)", True, "body", True),
    Factor("place", "x/k", "place along the surface", "x / k", True, "place"),
    Factor("release", "i/100", "number of the release", "trial / 100.0", False, "trial"),
)


@dataclass(frozen=True)
class Term:
    """A target and the factors of φ."""

    target: Target
    factors: tuple[Factor, ...]

    @property
    def name(self) -> str:
        """Name of its effect."""
        return f"{TARGETS[self.target].replace(' ', '_')}_by_{'_and_'.join(factor.name for factor in self.factors)}"

    @property
    def title(self) -> str:
        """Title of its effect, in figures and reports."""
        return f"{TARGETS[self.target]} by {' times '.join(factor.words for factor in self.factors)}"

    @property
    def symbol(self) -> str:
        """φ on paper."""
        return " · ".join(factor.symbol for factor in self.factors)

    @property
    def code(self) -> str:
        """φ in Python."""
        return " * ".join(f"({factor.code})" if len(self.factors) > 1 else factor.code for factor in self.factors)

    @property
    def equation(self) -> str:
        return {
            "epsilon": f"ε = ε₀ (1 + a {self.symbol})",
            "mu": f"μ = μ₀ (1 + a {self.symbol})",
            "direction": f"dc_t = a {self.symbol} dp, beside friction",
            "couple": f"dτ = a {self.symbol} k dp",
        }[self.target]

    @property
    def follows(self) -> bool:
        """Whether it acts along the path of the impact, and not on a coefficient before it."""
        return self.target in ("direction", "couple") or (
            self.target == "mu" and bool({"v_t", "omega"} & self.variables)
        )

    @property
    def variables(self) -> frozenset[str]:
        """Names in the code of φ: those of the module's table."""
        nodes = ast.walk(ast.parse(self.code, mode="eval"))
        return frozenset(node.id for node in nodes if isinstance(node, ast.Name) and node.id != "np")

    @property
    def along(self) -> tuple[str, ...]:
        """Coordinates that the term counts from the reference of the rig."""
        return tuple(name for name in ("x", "trial") if name in self.variables)

    @property
    def breaks_mirror(self) -> bool:
        """Whether it distinguishes left from right."""
        odd = sum(factor.odd for factor in self.factors) % 2 == 1
        return odd == (self.target in EVEN)


def testable_terms(has_angle: bool) -> list[Term]:
    """The terms that drops can test.

    If the angle is not measured, the unknown spin acts like a sideways impulse or a couple, and can explain any other
    error that depends on it.
    """
    terms = all_terms()
    if has_angle:
        return terms
    return [term for term in terms if term.target in EVEN and not term.variables & OF_SPIN]


def all_terms() -> list[Term]:
    """Every term of the library: single factors, then products that hold in a mirror."""
    pairs = [
        (one, other)
        for one, other in combinations(FACTORS, 2)
        if one.group != other.group and not (one.single or other.single)
    ]
    products: list[tuple[Factor, ...]] = [(factor,) for factor in FACTORS]
    products += pairs
    terms = [Term(target, factors) for target in TARGETS for factors in products]
    return [term for term in terms if len(term.factors) == 1 or not term.breaks_mirror]
