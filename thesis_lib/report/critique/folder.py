"""The folder that a critique writes: the same bytes from the command line and from the pipeline.

Of drops:

    impacts.csv  comparison.csv  errors.csv  ladder.csv  budget.csv   tables, explained in foundation/columns.yaml
    where.json  diagnosis.json  model.json                            schema 1 each; model.json predicts
    <picture>.png .pdf .csv                                           with the numbers drawn
    report.html                                                       one page, readable offline
    models.csv                                                        laws and engines, where they are compared

Of impacts that are too few for a verdict: impacts.csv, comparison.csv, diagnosis.json, model.json and report.html.
Of a mechanism: misfit.csv, mechanism_residuals.png .pdf .csv, diagnosis.json and report.html (`mechanisms`).
"""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from thesis_lib.critique.contacts.sliding import require_falling
from thesis_lib.critique.drops.criticise import Critique, criticise, whole_critique
from thesis_lib.critique.drops.few_impacts import FewImpacts
from thesis_lib.critique.drops.questions.where import where
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.results.diagnosis import diagnosis
from thesis_lib.critique.results.saved_model import save_model, saved
from thesis_lib.critique.results.tables import tables
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.folder import holds_data
from thesis_lib.datasets.format.samples import ArcSettings
from thesis_lib.datasets.recordings.recording import Recording, is_recording
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import write_json, write_result, write_text
from thesis_lib.foundation.randomness import generator
from thesis_lib.report.critique.whole_folder import MODEL_FILE, REGIONS, VERDICT_FILE, whole_folder

Say = Callable[[str], None]


def criticise_path(
    path: str | Path,
    folder: str | Path,
    seed: int,
    *,
    effects: Sequence[str] | None = None,
    models: Sequence[str] = (),
    proposal: str | Path | None = None,
    say: Say = lambda text: None,
) -> dict:
    """Criticise the drops or the recording in the folder `path`; UserError if the data cannot be read or criticised.

    The other arguments, and what is returned, are those of `critique_folder` and `recording_folder`.
    """
    if is_recording(path):
        from thesis_lib.datasets.recordings.read import read_recording

        if models:
            raise UserError(f"{path} is the recording of a mechanism; --models compares models of drops. Leave it out.")
        if proposal:
            raise UserError(f"{path} is the recording of a mechanism; --propose is for drops. Leave it out.")
        return recording_folder(read_recording(path), folder, seed, effects=effects, say=say)
    from thesis_lib.datasets.read import read_dataset

    options = {"effects": effects, "models": models, "proposal": proposal}
    return critique_folder(read_dataset(path), folder, seed, **options, say=say)


def critique_folder(
    dataset: Dataset,
    folder: str | Path,
    seed: int,
    *,
    effects: Sequence[str] | None = None,
    settings: CritiqueSettings | None = None,
    arcs: ArcSettings | None = None,
    models: Sequence[str] = (),
    proposal: str | Path | None = None,
    say: Say = lambda text: None,
) -> dict:
    """Criticise a dataset, write everything into `folder`, and return the content of diagnosis.json.

    Args:
        folder: made if needed; files of an earlier critique are replaced.
        seed: of the configuration; the stream also depends on the dataset's content.
        effects: switched on instead of the automatic choice; None lets the data choose, () allows none.
        settings, arcs: thresholds, and detection of impacts.
        models: what is compared beside the critique, of `critique.engines.compare.MODELS`.
        proposal: file for a term that is proposed where nothing fits; None: beside the folder, and only where `effects`
            is None.
        say: called with a line on each step.

    Too few impacts for a verdict give a smaller folder (`few_impacts`) with `"verdict": null`; with `effects`, `models`
    or a `proposal` they are refused.  UserError if there is no usable impact, or an effect is unknown or cannot be
    tested with it.
    """
    if models:
        require_falling(dataset.gravity, dataset.has_angle, dataset.header.surfaces or (), "--models")
    rng = generator(seed, "critique", dataset.digest())
    asks = whole_critique if models or proposal else criticise
    critique = asks(dataset, rng=rng, settings=settings, arcs=arcs, effects=effects, say=say)
    if isinstance(critique, FewImpacts):
        from thesis_lib.report.critique.few_impacts import write_few_impacts

        return write_few_impacts(critique, folder)
    compared = None
    if models:
        from thesis_lib.critique.engines.compare import compare_models

        compared = compare_models(critique, models, say)
    found, file = None, Path(proposal) if proposal else proposal_path(folder)
    unexplained = critique.verdict == "unexplained" and critique.is_structured
    asked = unexplained and critique.settings.max_terms and (proposal or effects is None)
    if asked:
        from thesis_lib.critique.proposal.propose import propose

        own = generator(seed, "proposal", dataset.digest())
        found = propose(critique, own, say)
    say("writing tables, pictures and report")
    if not asked:
        return write_critique(critique, folder, rng, compared)
    from thesis_lib.critique.proposal.results import content_of, not_testable, write_source

    more: dict[str, object] = {"proposal": content_of(found, write_source(found, file).name if found else "")}
    more["not_testable"] = not_testable(critique.observations.rig.has_angle)
    return write_critique(critique, folder, rng, compared, more)


def recording_folder(
    recording: Recording,
    folder: str | Path,
    seed: int,
    *,
    effects: Sequence[str] | None = None,
    say: Say = lambda text: None,
) -> dict:
    """The same for a recording: `effects` are the only ones tried, None tries all of the mechanism.

    UserError if the recording is too short, or an effect is unknown.
    """
    from thesis_lib.critique.mechanisms.critique import criticise_recording
    from thesis_lib.report.critique.mechanisms import write_mechanism_critique

    rng = generator(seed, "critique", recording.digest())
    say("fitting the equations of motion")
    critique = criticise_recording(recording, rng, effects=effects)
    say("writing tables, pictures and report")
    return write_mechanism_critique(critique, recording.name, folder, rng)


def proposal_path(folder: str | Path) -> Path:
    """The file beside the folder of a critique, or further up: out of a folder with data no code is loaded."""
    folder = Path(folder).resolve()
    outside = next(place for place in (folder, *folder.parents) if not any(map(holds_data, place.parents)))
    return outside.with_name(f"{folder.name}_proposal.py")


def write_critique(
    critique: Critique,
    folder: str | Path,
    rng: np.random.Generator,
    models: pd.DataFrame | None = None,
    more: Mapping | None = None,
) -> dict:
    """Write all files of a critique into `folder` and return the content of diagnosis.json.

    `models` is the table of `compare_models`, if models were compared; `more` are further keys of diagnosis.json.
    """
    # late, because the critique itself needs neither pictures nor pages
    from thesis_lib.figures.critique.pictures import pictures
    from thesis_lib.figures.style import png_of, save_figure
    from thesis_lib.report.critique.page import report_html

    regions = where(critique, rng)
    made = tables(critique, rng)
    content = diagnosis(critique, rng, made["ladder"])
    if more:
        from thesis_lib.critique.proposal.results import sentences

        content |= {**more, "not_testable": [*content["not_testable"], *more.get("not_testable", [])]}
        content["summary"] = [*content["summary"], *sentences(content)]
    if models is not None:
        made["models"] = models
        content["models"] = json.loads(models.to_json(orient="records"))
    drawn = pictures(critique, made, regions)
    images = {name: png_of(figure) for name, (figure, _) in drawn.items()}
    page = report_html(critique, content, regions, made, drawn, images)

    with whole_folder(folder) as part:
        for name, (figure, numbers) in drawn.items():
            # a picture of a table is stored with that table
            save_figure(figure, made.get(name, numbers), part / name, images[name])
        for name, table in made.items():
            write_result(table, part / f"{name}.csv")
        write_json(regions, part / REGIONS)
        final = critique.ladder[-1][1]
        save_model(saved(final, critique.observations.rig, critique.dataset), part / MODEL_FILE)
        write_text(page, part / "report.html")
        write_json(content, part / VERDICT_FILE)
    return content
