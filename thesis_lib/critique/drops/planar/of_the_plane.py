"""Questions of a critique that have an answer in the plane only, declared where they stand.

One planar body or two, releases that are worth a try, pictures of flights, the page's impact by impact: `of_the_plane`
says so of a function, and what it returns for a body in space.
"""

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from thesis_lib.mechanics.space import Space

P = ParamSpec("P")
T = TypeVar("T")
U = TypeVar("U")


def of_the_plane(otherwise: Callable[[], U]) -> Callable[[Callable[P, T]], Callable[P, T | U]]:
    """Decorator of a function that is not asked in space: there it returns `otherwise()`.

    The first of its arguments that has a `space` (`thesis_lib.mechanics.space.Space`) says where the body moves.
    """

    def declared(question: Callable[P, T]) -> Callable[P, T | U]:
        @wraps(question)
        def asked(*args: P.args, **kwargs: P.kwargs) -> T | U:
            spaces = (getattr(one, "space", None) for one in (*args, *kwargs.values()))
            space = next(space for space in spaces if isinstance(space, Space))
            return question(*args, **kwargs) if space.is_plane else otherwise()

        return asked

    return declared
