"""The face of the critique: from a folder, a dataset or a recording to a `Critique`, in one call.

The command line calls the same functions with the same seed, so that it gives the same numbers for the same data.
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
    """Criticise contact models against drops, or the believed model of a mechanism against its recording.

    Fewer than 30 usable impacts in 10 trials give restitution and friction without a verdict, unless more was asked.

    Args:
        data: folder of a dataset or of a recording, or what was read from one, or made of arrays (`dataset_of`).
        effects: switched on instead of the automatic choice; None lets the data choose, () allows none.  Of a
            recording: the only ones tried.
        settings, arcs: thresholds of the critique, and the detection of impacts.
        models: what is compared beside the critique, of `thesis_lib.critique.engines.compare.MODELS`.
        propose: whether a term is looked for where no effect explains the rest; None: only where `effects` is None.
        jobs: processes of the search for effects of drops; no result depends on their number.
        seed: of splits and resamples, whose streams depend on the content of the data, too.
        say: receives a line for each step.

    Raises:
        DatasetError: the data are not as the format asks; `problems` lists all that is wrong.
        TooFew: no usable impact and, in space, no trajectories, or too few for what was asked (effects, models, a
            proposal).
        UserError: a channel that is constant, contacts too long for an impact, more than one planar rigid body, or an
            effect or a model that is unknown or cannot be tested.
    """
    if isinstance(data, (str, Path)):
        data = read(data)
    if isinstance(data, Recording):
        for option, asked in (("models", models), ("propose", propose), ("settings", settings), ("arcs", arcs)):
            if asked:
                raise UserError(f"{data.name} is the recording of a mechanism; {option} is for drops. Leave it out.")
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
    """The dataset or the recording in a folder; DatasetError lists all that is wrong in it."""
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
    """One law with named effects, fitted to all impacts and flights of a dataset: it predicts, and can be saved.

    Args:
        data: folder of a dataset, or a `Dataset`.
        law: a key of `thesis_lib.contact.LAWS`, or a compliant contact.
        effects: keys of `thesis_lib.effects.EFFECTS`.
        settings, arcs: of episodes and contact times, and of the detection of impacts.

    Returns:
        The model with its parameters: value, standard error, unit.

    Raises:
        DatasetError: the data are not as the format asks.
        TooFew: there is no usable impact.
        UserError: law or effect is unknown, these data cannot test it, or what `criticise` refuses.
    """
    dataset = read(data) if isinstance(data, (str, Path)) else data
    if isinstance(dataset, Recording):
        raise UserError(f"{dataset.name} is the recording of a mechanism; fit fits laws of impact to drops.")
    fitted = fit_model(dataset, law, effects, settings, arcs)
    return saved_of(fitted, fitted.whitening.observations.rig, dataset.name, dataset)  # pyright: ignore[reportReturnType]
