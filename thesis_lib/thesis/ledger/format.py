"""Format of config/claims/: each number and each ordering stated in the thesis, in one file for each chapter.

Statements published with the measured cube also have a file, with its own chapter number, `CUBE`.

```yaml
schema: 1
defaults: {chapter: 3}        # optional: `chapter` and `needs` for claims without them
checks:                       # optional: checks that several claims share, by YAML's anchors
  - &two_errors {kind: interval, k: 2, reason: two bootstrap standard errors}
notes:                        # optional: the same for notes
  - &flat_cost the cost is flat here, so that many pairs fit nearly as well
weak:                         # optional: the same for reasons why agreement is weak evidence
  - &recount this recounts the authors' own file
quick:                        # optional: the same for reasons why the quick scale cannot decide
  - &too_few 150 impacts are too few
claims:
  - id: table_3_1.mirtich.mu.as_published     # unique, dotted
    location: Table 3.1, row Mirtich, column mu
    statement: The friction coefficient that fits Mirtich's law, as coded by the authors, to all impacts.
    published: 0.062          # as stated in the thesis (may be left out: see below)
    unit: "1"
    source:                   # our value, below the results folder
      file: chapter3/planar_impact/table_3_1.csv
      where: {law: mirtich_as_published}      # selects exactly one row (orderings: the rows compared)
      column: mu
      std_column: mu_std      # optional: our standard error
    check: {kind: abs, tolerance: 0.01, reason: two bootstrap standard errors and the rounding to 0.001}
    needs: [planar_impact]    # datasets; if one is missing, the claim shows "data not present"
    note: why ours deviates, if known; shown only if it deviates     # optional
  - id: table_3_1.mirtich.epsilon.as_published
    location: Table 3.1, row Mirtich, column epsilon
    statement: The restitution coefficient that fits Mirtich's law, as coded by the authors, to all impacts.
    published: 0.548
    source: {file: chapter3/planar_impact/table_3_1.csv, where: {law: mirtich_as_published}, column: epsilon,
      std_column: epsilon_std}
    check: *two_errors        # the check above
    note: *flat_cost
    weak: *recount            # why a wrong result could also agree, if so                   # optional
    quick: *too_few           # why the quick scale is too noisy to decide, if so            # optional
```

- abs, rel and interval (kinds of checks: `checks`) need a `published` number; greater and less may have one, which is
  shown.  The other checks contain the published statement; `published` may repeat but not contradict it.
- `where` compares text exactly and numbers to 8 digits; it may name several columns.
- A tolerance or a k requires a `reason`; so does a threshold that differs from `published`, or from 0 if nothing is
  published.
- `weak` states why agreement is weak evidence: a wrong result would pass, a criterion was chosen on our own data, or
  the number is not from the thesis.  Such claims are counted separately.
- At the quick scale, a claim with `quick` is compared and shown, but not decided; at any scale, this applies to a claim
  whose check with a margin of k standard errors fails by less than the margin.
- A folder is read as one ledger, with files ordered by name.  Shared parts are valid within one file.
"""

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.settings import Section
from thesis_lib.thesis.ledger.checks import (
    Check,
    Extreme,
    Interval,
    IsTrue,
    Ordering,
    Published,
    SourceCell,
    Threshold,
    Within,
)
from thesis_lib.thesis.ledger.reading import Name, Text, load_yaml, validate

Chapter = Annotated[int, Field(ge=1, le=9)]
CUBE = 6  # chapters of the thesis with claims are 2 to 5


class Claim(Section):
    """One statement of the thesis and its comparison with our value."""

    id: Annotated[str, StringConstraints(pattern=r"^[a-z0-9_-]+(\.[a-z0-9_-]+)+$")]
    chapter: Chapter
    location: Text
    statement: Text = Field(description="one sentence that is clear without context")
    published: Published = None
    unit: Text = "1"
    source: SourceCell
    check: Check
    needs: list[Name] = Field([], description="datasets without which nothing is compared")
    note: Text | None = None
    weak: Text | None = Field(None, description="why agreement is weak evidence: a wrong result could also agree")
    quick: Text | None = Field(None, description="why the quick scale is too noisy to decide it")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        check, number = self.check, type(self.published) in (int, float)
        if isinstance(check, Within | Interval) and not number:
            raise ValueError(f"published must be a number, since the check is of kind {check.kind}")
        if check.kind == "rel" and self.published == 0:
            raise ValueError("published is 0, so a relative tolerance admits no deviation: use kind abs")
        if isinstance(check, Threshold) and self.published is not None and not number:
            raise ValueError(f"published must be a number or left out, since the check is of kind {check.kind}")
        if isinstance(check, Threshold) and not check.reason and check.threshold != (self.published or 0.0):
            raise ValueError(f"check.reason is missing: state why the threshold is {check.threshold:g}")
        stated = "rows" if isinstance(check, Ordering) else "row" if isinstance(check, Extreme) else ""
        if stated and self.published is not None and self.published != getattr(check, stated):
            raise ValueError(f"published contradicts check.{stated}; leave it out")
        if isinstance(check, IsTrue) and self.published not in (None, True):
            raise ValueError("published can only be true here; leave it out")
        if (isinstance(check, Interval) or getattr(check, "k", 0)) and self.source.std_column is None:
            raise ValueError("source.std_column is missing: the check uses standard errors")
        return self


class Defaults(Section):
    """Values for claims of a file that do not give their own."""

    chapter: Chapter | None = None
    needs: list[Name] | None = None


class Ledger(Section):
    """The claims of one file or of a whole folder."""

    schema_: Literal[1] = Field(alias="schema", description="version of this format")
    defaults: Defaults = Field(Defaults(), description="values for claims that do not give their own")
    checks: list[Check] = Field([], description="that several claims share")
    notes: list[Text] = Field([], description="that several claims share")
    weak: list[Text] = Field([], description="that several claims share")
    quick: list[Text] = Field([], description="that several claims share")
    claims: list[Claim]


def read_ledger(path: str | Path) -> Ledger:
    """Read config/claims/, or one file of claims; UserError with the file, line and claim of each mistake."""
    path = Path(path)
    files = sorted(path.glob("*.yaml")) if path.is_dir() else [path]
    problems = [] if files else [f"{path} contains no .yaml file of claims."]
    claims: list[Claim] = []
    for file in files:
        try:
            claims += _read_file(file).claims
        except UserError as error:
            problems.append(str(error))
    counts = Counter(claim.id for claim in claims)
    problems += [f"{path}: claim {id} occurs more than once; keep one." for id, n in counts.items() if n > 1]
    if problems:
        raise UserError("\n".join(problems))
    return Ledger(schema=1, claims=claims)


def _read_file(path: Path) -> Ledger:
    """Read one file, with its defaults inserted into its claims."""
    document = load_yaml(path)
    content, lines = document.content, dict(document.lines)
    if isinstance(content, dict) and isinstance(content.get("claims"), list):
        defaults = content.get("defaults")
        defaults = defaults if isinstance(defaults, dict) else {}
        claims = [defaults | claim if isinstance(claim, dict) else claim for claim in content["claims"]]
        places = {("claims", i, key): ("defaults", key) for i in range(len(claims)) for key in defaults}
        lines = {place: lines[default] for place, default in places.items() if default in lines} | lines
        document = replace(document, content=content | {"claims": claims}, lines=lines)
    return validate(Ledger, document, path)
