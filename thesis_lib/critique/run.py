"""Entry points of the critique: from a folder, a dataset or a recording to a `Critique` in one call.

The command line calls the same functions with the same seed and so gives the same numbers for the same data.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

from threadpoolctl import threadpool_limits

from thesis_lib.critique.drops.criticise import criticise_drops, fit_model
from thesis_lib.critique.drops.few_impacts import TooFew, few_impacts
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.result import Critique, OfDrops, OfFewImpacts, OfMechanism
from thesis_lib.critique.results.findings import saved_of
from thesis_lib.critique.results.saved_model import SavedModel
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.samples import ArcSettings
from thesis_lib.datasets.recordings.recording import Recording, is_recording, read_recording
from thesis_lib.foundation import SEED
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.forked import sharing
from thesis_lib.foundation.randomness import generator

Data = Dataset | Recording | str | Path


def criticise(
    data: Data,
    *,
    effects: Sequence[str] | None = None,
    settings: CritiqueSettings | None = None,
    arcs: ArcSettings | None = None,
    models: Sequence[str] = (),
    propose: bool | None = None,
    jobs: int = 1,
    seed: int = SEED,
    say: Callable[[str], None] = lambda text: None,
) -> Critique:
    """Compare contact models with measured drops, or the assumed model of a mechanism with its recording.

    With fewer than 30 usable impacts in 10 trials, only restitution and friction are estimated, without a verdict,
    unless more was requested.

    Args:
        data: folder of a dataset or a recording, or the object read from it or made of arrays (`dataset_of`).
        effects: effects to switch on instead of the automatic choice; None: chosen from the data; (): none.  For a
            recording, the only effects that are tried.
        settings, arcs: thresholds of the critique, and settings of the detection of impacts.
        models: names of models to compare as well, from `thesis_lib.critique.engines.compare.MODELS`.
        propose: whether to search for a new term if no effect explains the rest; None: only if `effects` is None.
        jobs: number of processes in the search for effects of drops; no result depends on it.
        seed: seed of splits and resamples; their streams also depend on the content of the data.
        say: function that receives one line of text per step.

    Raises:
        DatasetError: the data violate the format; `problems` lists all violations.
        TooFew: no usable impact and, in space, no trajectories, or too few for the request (effects, models, propose).
        UserError: a channel is constant, contacts last too long for impacts, the motion is not that of one planar
            rigid body, or an effect or a model is unknown or cannot be tested.
    """
    if isinstance(data, (str, Path)):
        data = read(data)
    if isinstance(data, Recording):
        for option, asked in (("models", models), ("propose", propose), ("settings", settings), ("arcs", arcs)):
            if asked:
                raise UserError(f"{data.name} is the recording of a mechanism; {option} is for drops: leave it out.")
        from thesis_lib.critique.mechanisms.critique import criticise_recording

        rng = generator(seed, "critique", data.digest())
        say("fitting the equations of motion")
        return OfMechanism(criticise_recording(data, rng, effects=effects), data.name, rng, say)
    with sharing(jobs):
        if models:
            from thesis_lib.critique.engines.compare import require_models

            require_models(data, models)
        settings, content = settings or CritiqueSettings(), data.digest()
        rng = generator(seed, "critique", content)
        try:
            found = criticise_drops(data, rng=rng, settings=settings, arcs=arcs, effects=effects, say=say)
        except TooFew as few:
            if effects or models or propose or not few.say_something:
                raise
            say("too few impacts for a verdict: fitting restitution and friction")
            with threadpool_limits(limits=1):  # as `criticise_drops`
                return OfFewImpacts(few_impacts(few, settings), say)
        proposals = []
        if propose is None:
            propose = effects is None
        if (
            propose
            and found.space.is_plane
            and found.verdict == "unexplained"
            and found.is_structured
            and found.settings.max_terms
        ):
            from thesis_lib.critique.proposal.propose import propose as propose_term

            proposals = [propose_term(found, generator(seed, "proposal", content), say)]
        critique = OfDrops(found, rng, proposals, say)
        if models:
            critique.compare(models)
        return critique


def read(path: str | Path) -> Dataset | Recording:
    """Read the dataset or the recording in a folder; DatasetError lists all violations of the format."""
    if is_recording(path):
        return read_recording(path)
    from thesis_lib.datasets.read import read_dataset

    return read_dataset(path)


def fit(
    data: Data,
    law: str = "mirtich",
    effects: Sequence[str] = (),
    *,
    settings: CritiqueSettings | None = None,
    arcs: ArcSettings | None = None,
) -> SavedModel:
    """Fit one law with named effects to all impacts and flights of a dataset, to predict or to save.

    Args:
        data: folder of a dataset, or a `Dataset`.
        law: a key of `thesis_lib.contact.LAWS`, or a compliant contact.
        effects: keys of `thesis_lib.effects.EFFECTS`.
        settings, arcs: settings of episodes and contact times, and of the detection of impacts.

    Returns:
        The model with its parameters: value, standard error, unit.

    Raises:
        DatasetError: the data violate the format.
        TooFew: there is no usable impact.
        UserError: the law or an effect is unknown or cannot be tested by these data, or as for `criticise`.
    """
    dataset = read(data) if isinstance(data, (str, Path)) else data
    if isinstance(dataset, Recording):
        raise UserError(f"{dataset.name} is the recording of a mechanism; `fit` is for drops only.")
    fitted = fit_model(dataset, law, effects, settings, arcs)
    return saved_of(fitted, fitted.whitening.observations.rig, dataset.name, dataset)  # pyright: ignore[reportReturnType]
