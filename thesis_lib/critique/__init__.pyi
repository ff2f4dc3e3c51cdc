"""For type checkers: what this package gives out; __init__.py imports it on first use."""

from thesis_lib.critique.drops.criticise import Critique as Critique
from thesis_lib.critique.drops.criticise import FewImpacts as FewImpacts
from thesis_lib.critique.drops.criticise import criticise as criticise
