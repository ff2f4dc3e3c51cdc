"""Base of every typed section of YAML: unknown keys are refused, checked values are immutable."""

from collections.abc import Mapping
from typing import Any, dataclass_transform

from pydantic import BaseModel, ConfigDict


@dataclass_transform(kw_only_default=True, field_specifiers=())
class SectionType(type(BaseModel)):
    """For type checkers: a value assigned to a field is its default, `Field(0.3, ge=0.0)` included."""


class Section(BaseModel, metaclass=SectionType):
    """A section of dataset.yaml or of the configuration."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def merged(base: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """The keys of `base` with those of `values` in their place, section by section."""
    both = [key for key in values if isinstance(values[key], dict) and isinstance(base.get(key), dict)]
    return {**base, **values, **{key: merged(base[key], values[key]) for key in both}}
