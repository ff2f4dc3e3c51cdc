"""Base of every typed section of YAML: unknown keys are refused, values cannot change after the check."""

from pydantic import BaseModel, ConfigDict


class Section(BaseModel):
    """A section of dataset.yaml or of the configuration."""

    model_config = ConfigDict(extra="forbid", frozen=True)
