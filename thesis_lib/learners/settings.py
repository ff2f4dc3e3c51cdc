"""Settings of learned contact models."""

from typing import Literal

from pydantic import Field

from thesis_lib.foundation.settings import Section


class GaussianProcessSettings(Section):
    """Settings of the training of Gaussian processes; all own choices."""

    restarts: int = Field(2, ge=1, description="starts of the search for hyperparameters, the fixed one included")
    prior: bool = Field(True, description="weak log-normal priors: without them ten impacts are overfitted")
    robust_rounds: int = Field(2, ge=0, description="rounds that give outliers less weight; 0: all weights are equal")
    iterations: int = Field(100, ge=1, description="most L-BFGS iterations of a start")
    hyperparameter_impacts: int = Field(450, ge=10, description="first impacts used to find them; predictions use all")
    device: Literal["auto", "cpu", "cuda"] = Field("auto", description="auto: a CUDA GPU if there is one")
