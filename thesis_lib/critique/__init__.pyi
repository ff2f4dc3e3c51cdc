"""For type checkers: what this package gives out; __init__.py imports it on first use."""

from thesis_lib.critique.drops.few_impacts import TooFew as TooFew
from thesis_lib.critique.result import Critique as Critique
from thesis_lib.critique.run import criticise as criticise
from thesis_lib.critique.run import fit as fit
