"""Settings of chapter 5's learners.

The thesis gives the range of the number of experts and "truncation about ten times the expected number"; the rest are
own choices from development towers.  `prior_std`, `weight_decay` and `ridge` are each the best of three values in how
well 100 samples of one training set predict those of the others.
"""

from pydantic import Field

from thesis_lib.foundation.settings import Section


class PushWindowSettings(Section):
    """Windows of samples within one push (the inner plate of figure 5-3)."""

    depth: int = Field(5, ge=1, le=45, description="D, steps in a window; shorter at the start of a push")
    force_scale: float = Field(0.1, gt=0, description="N; forces enter the inputs as asinh(f / force_scale)")


class MixtureSettings(Section):
    """Top-down step: Dirichlet-process mixture over windows, merged into abstractions."""

    truncation: int = Field(20, ge=2, description="components at which stick-breaking is truncated")
    alpha: float = Field(1.0, gt=0, description="concentration of the stick-breaking process")
    min_weight: float = Field(0.02, ge=0, lt=0.5, description="components below this share are dropped")
    regularisation: float = Field(0.03, gt=0, description="added to the variance of each scaled feature")
    overlap: float = Field(2.0, ge=1, description="a window counts as 1/overlap: neighbours share samples")
    topic_prior: float = Field(2.0, gt=0, description="a of the Dirichlet prior of the topics, in windows")
    min_abstractions: int = Field(2, ge=1, description="merging stops at this number at the latest")
    max_abstractions: int = Field(6, ge=2, description="merging continues at least to this number")


class BeliefSettings(Section):
    """Bayes filter over abstractions."""

    stay: float = Field(0.98, gt=0, le=1, description="probability that the abstraction lasts another step")
    outlier_share: float = Field(0.03, ge=0, lt=0.5, description="share of outliers in each dimension")
    outlier_scale: float = Field(6.0, gt=1, description="standard deviation of outliers over the predicted one")
    emission_weight: float = Field(1.0, ge=0, le=1, description="power of the window mixture after the first step")


class NetworkSettings(Section):
    """Bayesian and plain networks (the same training budget for both)."""

    hidden: tuple[int, ...] = Field((16, 16), min_length=1, description="units of each hidden layer")
    iterations: int = Field(1200, ge=1, description="steps of Adam")
    batch: int = Field(256, ge=8, description="samples a step; all of them where there are fewer")
    rate: float = Field(0.01, gt=0, description="initial learning rate; falls to a tenth along a cosine")
    prior_std: float = Field(0.5, gt=0, description="of the weights around their shared mean, times 1/√fan-in")
    shared_std: float = Field(1.0, gt=0, description="of that shared mean around zero, times 1/√fan-in")
    warm_up: float = Field(0.3, ge=0, le=1, description="share of the steps in which the KL weight rises to 1")
    draws: int = Field(4, ge=2, multiple_of=2, description="weight draws averaged in a prediction")
    weight_decay: float = Field(3.0, ge=0, description="plain network: precision of the weights' prior")


class ExpertSettings(Section):
    """Mixture of linear regressions."""

    fewest: int = Field(2, ge=1, description="experts, thesis")
    most: int = Field(11, ge=1, description="experts, thesis")
    folds: int = Field(5, ge=2, description="of the cross-validation over pushes, thesis")
    ridge: float = Field(3.0, gt=0, description="precision of a coefficient of scaled inputs and outputs")
    restarts: int = Field(3, ge=1, description="random starts of EM")
    iterations: int = Field(60, ge=1, description="most steps of EM")


class NutsSettings(Section):
    """The No-U-Turn sampler (own choices; the thesis states only that it uses Hamiltonian Monte Carlo)."""

    chains: int = Field(4, ge=4, description="chains, run side by side")
    warm_up: int = Field(300, ge=50, description="adaptation steps, discarded")
    draws: int = Field(300, ge=50, description="draws of each chain")
    target_accept: float = Field(0.85, gt=0.5, lt=1, description="acceptance that the step size aims at")
    max_tree_depth: int = Field(8, ge=4, le=10, description="most doublings of a trajectory")


class LearnerSettings(Section):
    """All learners of chapter 5."""

    window: PushWindowSettings = PushWindowSettings()
    mixture: MixtureSettings = MixtureSettings()
    belief: BeliefSettings = BeliefSettings()
    network: NetworkSettings = NetworkSettings()
    experts: ExpertSettings = ExpertSettings()
    context: bool = Field(
        False, description="layers above and side are inputs; own choice: a dozen pushes do not show their influence"
    )
    one_shot: bool = Field(False, description="HMA: learn abstractions and transitions jointly (ablation)")
    rounds: int = Field(12, ge=2, description="HMA one-shot: alternations of responsibilities and networks")
