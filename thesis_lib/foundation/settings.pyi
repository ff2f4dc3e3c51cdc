"""For type checkers, which take `Field(0.3)` for a field without default: here whatever is assigned is a default."""

from typing import dataclass_transform

from pydantic import BaseModel
from pydantic._internal._model_construction import ModelMetaclass

@dataclass_transform(kw_only_default=True, field_specifiers=())
class _SectionType(ModelMetaclass): ...

class Section(BaseModel, metaclass=_SectionType): ...
