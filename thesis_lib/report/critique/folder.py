"""The folder that a critique writes: the same bytes from the command line, the library and the pipeline.

Of drops:

    impacts.csv  comparison.csv  errors.csv  ladder.csv  budget.csv   tables, explained in foundation/columns.yaml
    where.json  diagnosis.json  model.json                            schema 1 each; model.json predicts
    <picture>.png .pdf .csv                                           with the numbers drawn
    report.html                                                       one page, readable offline
    models.csv                                                        laws and engines, where they are compared

Of impacts that are too few for a verdict: impacts.csv, comparison.csv, diagnosis.json, model.json and report.html.
Of a mechanism: misfit.csv, mechanism_residuals.png .pdf .csv, diagnosis.json and report.html.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from thesis_lib.critique.results.findings import Findings
from thesis_lib.figures.style import Drawn, save_figure
from thesis_lib.foundation.files import write_json, write_result, write_text
from thesis_lib.report.critique.whole_folder import MODEL_FILE, REGIONS, VERDICT_FILE, whole_folder


@dataclass(frozen=True)
class Contents:
    """What is shown of the findings: `page` is report.html, `images` the pictures as PNG where they have been made."""

    page: str
    pictures: Mapping[str, Drawn] = field(default_factory=dict)
    images: Mapping[str, bytes] = field(default_factory=dict)


def write_critique(findings: Findings, contents: Contents, folder: str | Path) -> None:
    """Write all files of a critique into `folder`, which is made if needed; those of an earlier one are replaced."""
    with whole_folder(folder) as part:
        for name, (figure, numbers) in contents.pictures.items():
            # a picture of a table is stored with that table
            save_figure(figure, findings.tables.get(name, numbers), part / name, contents.images.get(name))
        for name, table in findings.tables.items():
            write_result(table, part / f"{name}.csv")
        if findings.regions is not None:
            write_json(findings.regions, part / REGIONS)
        if findings.model is not None:
            findings.model.save(part / MODEL_FILE)
        write_text(contents.page, part / "report.html")
        write_json(findings.diagnosis, part / VERDICT_FILE)
