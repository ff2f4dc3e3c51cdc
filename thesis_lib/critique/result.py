"""Result of `criticise`: the verdict as text, numbers, files and figures.

A `Critique` is of one of three kinds, `OfDrops`, `OfFewImpacts` or `OfMechanism`, with the same methods.  Numbers, page
and figures are computed once, when they are first needed; the order of the calls does not change them.
"""

from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.drops.few_impacts import FewImpacts
from thesis_lib.critique.mechanisms.critique import MechanismCritique
from thesis_lib.critique.printed import diagnosis_text
from thesis_lib.critique.results.candidates import choices_table
from thesis_lib.critique.results.findings import Findings, few_findings, findings
from thesis_lib.critique.results.saved_model import SavedModel
from thesis_lib.foundation.errors import UserError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from thesis_lib.critique.proposal.propose import Proposal
    from thesis_lib.report.critique.folder import Contents

Say = Callable[[str], None]


class Critique:
    """Result of the critique of one dataset or recording.

    Attributes:
        name: name of the dataset or recording.
        found: the fits and judgements behind the verdict.
        plots: names of the figures that `plot` draws.
    """

    name: str
    found: DropsCritique | FewImpacts | MechanismCritique
    plots: tuple[str, ...] = ()

    def __repr__(self) -> str:
        named = f" ({', '.join(self.effects)})" if self.effects else ""
        return f"<Critique of {self.name}: {self.verdict or 'no verdict'}{named}{self._error}>"

    @property
    def verdict(self) -> str | None:
        """The verdict: adequate, effects or unexplained; None if there are too few impacts for one."""
        return self.found.verdict

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects found, in the order in which they entered the model."""
        return ()

    def to_dict(self) -> dict:
        """Content of diagnosis.json: numbers in SI units, and sentences (keys: `critique/results/diagnosis.py`)."""
        return self._diagnosis("")

    def summary(self) -> str:
        """Text that the command line prints: verdict, sentences, errors, parameters, the next experiment."""
        return diagnosis_text(self.to_dict())

    def save(self, folder: str | Path, *, proposal: str | Path | None = None) -> dict:
        """Write tables, pictures, model.json, report.html and diagnosis.json, and return the content of the last.

        Args:
            folder: output folder, created if needed; files of an earlier critique are replaced, others are kept.
            proposal: effect file for a term proposed because no known effect fits; None: beside the folder.

        Raises:
            OSError: the folder cannot be written; an earlier critique in it then stays unchanged.
        """
        from thesis_lib.report.critique.folder import write_critique

        self._say("writing tables, pictures and report")
        content = self._diagnosis(self._write_proposal(folder, proposal))
        found = replace(self._findings, diagnosis=content)
        write_critique(found, self._contents(found), folder)
        return content

    @property
    def model(self) -> SavedModel:
        """The fitted law with its effects, as in model.json; UserError for a mechanism."""
        if (model := self._findings.model) is None:
            raise UserError(f"{self.name} is the recording of a mechanism; model.json exists for drops only.")
        return model

    def predict(self, states: pd.DataFrame | Mapping[str, ArrayLike]) -> pd.DataFrame:
        """Velocities after impact, predicted by the fitted law with its effects.

        Args:
            states: columns x, y, theta, vx, vy, omega (n,) at first touch in m, rad, m/s and rad/s; `trial` and `t` if
                an effect depends on them.  In space, the columns of an impacts.csv of schema 2 without those in _post.

        Returns:
            The states with vx_post, vy_post, omega_post and `status`: ok, not_approaching or no_solution.  A warning
            names rows in which the body is far above or below the surface.

        Raises:
            UserError: a column is missing, a value is not a finite number, or the critique is of a mechanism.
        """
        return self.model.predict(states)

    def plot(self, what: str = "") -> "Figure":
        """One of the figures named in `plots`, by default the first, as a Matplotlib figure.

        "ladder": the held-out error (m/s) after each effect; "candidates": the gain of each effect alone; "map": where
        the model errs, before and after; for a mechanism, "residuals".  UserError if there is no such figure.
        """
        what = what or (self.plots[0] if self.plots else "")
        if what not in self.plots:
            known = f"available are {', '.join(self.plots)}" if self.plots else "there are none for so few impacts"
            raise UserError(f"The critique of {self.name} has no figure {what!r}; {known}.")
        return self._draw(what)

    # --- overridden by each kind ---

    _say: Say = staticmethod(lambda text: None)

    @cached_property
    def _findings(self) -> Findings:
        raise NotImplementedError

    @property
    def _error(self) -> str:
        """Text on the held-out error, for `repr`."""
        return ""

    def _diagnosis(self, file: str) -> dict:
        """Content of diagnosis.json; `file`: name of the effect file of the proposal, "" if none was written."""
        return self._findings.diagnosis

    def _write_proposal(self, folder: str | Path, path: str | Path | None) -> str:
        """Write the effect file of the proposed term and return its name; "" if no term is proposed."""
        return ""

    def _contents(self, found: Findings) -> "Contents":
        raise NotImplementedError

    def _draw(self, what: str) -> "Figure":
        raise NotImplementedError


class OfDrops(Critique):
    """The critique of drops.

    Args:
        rng: generator in the state in which the search left it.
        proposals: result of the search for a new term, one `Proposal` or None; empty if there was no such search.
        say: function that receives one line of text per step.
    """

    found: DropsCritique

    def __init__(
        self,
        found: DropsCritique,
        rng: np.random.Generator,
        proposals: "Sequence[Proposal | None]" = (),
        say: Say = lambda text: None,
    ) -> None:
        self.name, self.found, self._proposals = found.dataset, found, tuple(proposals)
        self.plots = ("ladder", "candidates", "map") if found.space.is_plane else ("ladder", "candidates")
        self._rng, self._say = rng, say
        self.models: pd.DataFrame | None = None

    def compare(self, models: Sequence[str]) -> pd.DataFrame:
        """Laws and engines, fitted to the same training trials and judged on the same held-out trials, best first.

        Args:
            models: names from `thesis_lib.critique.engines.compare.MODELS`: "laws", "mujoco", "drake", ...

        Returns:
            The table of `compare_models`; diagnosis.json (key `models`) and the page then contain it, too.

        Raises:
            UserError: an engine is not installed, or the body slides on a table, has no angle or falls between walls.
        """
        from thesis_lib.critique.engines.compare import compare_models

        self.models = compare_models(self.found, models, self._say)
        self.__dict__.pop("_findings", None)
        return self.models

    @property
    def choices(self) -> pd.DataFrame:
        """Held-out error with each combination of the effects found and their closest rival, as in choices.csv.

        Columns: effects (joined by +, or “no effect”), law, error, error_low, error_high (m/s, 95 %); no rows if no
        effect or more than three were found.
        """
        found = self._findings.tables.get("choices")
        return choices_table([]) if found is None else found.copy()

    @property
    def effects(self) -> tuple[str, ...]:
        return tuple(step.effect.name for step in self.found.discovery.steps if step.clears)

    @property
    def _error(self) -> str:
        ends = [f"{judged.error.mean():.3g}" for _, _, judged in (self.found.ladder[0], self.found.ladder[-1])]
        return f", held-out error {' -> '.join(dict.fromkeys(ends))} m/s"

    @cached_property
    def _findings(self) -> Findings:
        return findings(self.found, deepcopy(self._rng), self.models)

    def _diagnosis(self, file: str) -> dict:
        content = self._findings.diagnosis
        if not self._proposals:
            return content
        from thesis_lib.critique.proposal.results import with_proposal

        return with_proposal(content, self._proposals[0], file, self.found)

    def _write_proposal(self, folder: str | Path, path: str | Path | None) -> str:
        if not self._proposals or self._proposals[0] is None:
            return ""
        from thesis_lib.critique.proposal.results import proposal_path, write_source

        to = Path(path) if path else proposal_path(folder)
        return write_source(self._proposals[0], to, self.found.settings).name

    def _contents(self, found: Findings) -> "Contents":
        from thesis_lib.report.critique.page import contents

        return contents(self.found, found)

    def _draw(self, what: str) -> "Figure":
        from thesis_lib.figures.critique.candidates import draw_candidates
        from thesis_lib.figures.critique.errors import draw_ladder
        from thesis_lib.figures.critique.where import draw_where

        if what == "ladder":
            return draw_ladder(self.found, self._findings.tables["ladder"])[0]
        if what == "candidates":
            if (drawn := draw_candidates(self.found, self._findings.tables.get("candidates"))) is None:
                raise UserError(f"The critique of {self.name} tried no effects: run it again without `effects`.")
            return drawn[0]
        return draw_where(self.found, self._findings.regions)[0]  # pyright: ignore[reportArgumentType]


class OfFewImpacts(Critique):
    """The critique of too few impacts for a verdict: restitution and friction with standard errors."""

    found: FewImpacts

    def __init__(self, found: FewImpacts, say: Say = lambda text: None) -> None:
        self.name, self.found, self._say = found.dataset, found, say

    @cached_property
    def _findings(self) -> Findings:
        return few_findings(self.found)

    def _contents(self, found: Findings) -> "Contents":
        from thesis_lib.report.critique.few_impacts import few_contents

        return few_contents(self.found, found)


class OfMechanism(Critique):
    """The critique of a mechanism; `rng` is in the state in which the search left it."""

    found: MechanismCritique
    plots = ("residuals",)

    def __init__(
        self, found: MechanismCritique, name: str, rng: np.random.Generator, say: Say = lambda text: None
    ) -> None:
        self.name, self.found, self._rng, self._say = name, found, rng, say

    @property
    def effects(self) -> tuple[str, ...]:
        return tuple(step.effect.name for step in self.found.steps if step.clears)

    @property
    def _error(self) -> str:
        ends = dict.fromkeys(f"{self.found.ladder[i][0]:.3g}" for i in (0, -1))
        return f", held-out misfit {' -> '.join(ends)} standard deviations of noise"

    @cached_property
    def _findings(self) -> Findings:
        from thesis_lib.report.critique.mechanisms import mechanism_findings

        return mechanism_findings(self.found, self.name, self._rng)

    def _contents(self, found: Findings) -> "Contents":
        from thesis_lib.report.critique.mechanisms import mechanism_contents

        return mechanism_contents(self.found, found)

    def _draw(self, what: str) -> "Figure":
        return self._contents(self._findings).pictures["mechanism_residuals"][0]
