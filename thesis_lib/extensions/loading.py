"""User-defined effects and laws: loaded from named files, or from installed packages that offer them.

A file is a Python program that binds one of these names, or one name for effects and one for laws:

    EFFECT = MyEffect()        EFFECTS = (First(), Second())        LAW = Law(...)        LAWS = (one, other)

A package offers them as entry points in the groups `thesis_lib.effects` and `thesis_lib.laws`, each an effect or a law,
a tuple of them, or a module like such a file:

    [project.entry-points."thesis_lib.effects"]
    sticky = "my_package.sticky:EFFECT"

Loading runs code with the permissions of the user.  Therefore a file runs only if its path was given, never because of
its location; a note is printed before it runs; and no code runs from a folder with data, which may be a stranger's.
Effects and laws that do not satisfy the contracts of the library are rejected.  The SHA-256 that identifies a file in
results covers this file alone, not the modules that it imports; for a package it covers all its Python files.
"""

import contextlib
import hashlib
import importlib.metadata
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from types import ModuleType

from thesis_lib.contact import LAWS, Law
from thesis_lib.datasets.format.folder import holds_data
from thesis_lib.effects import EFFECTS, Effect
from thesis_lib.extensions import effect_contract, law_contract
from thesis_lib.extensions.contract import CheckResult, outcomes, raised
from thesis_lib.extensions.registry import PACKAGE, VERSION, Loaded, Origin, add, contents, require_free
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.regular_file import FileProblem, read_bytes

MAX_CODE = 1_000_000  # bytes; the longest module of the library has 20 kB
MAX_NAME = 200  # characters in the name of a file
GROUPS = ("thesis_lib.effects", "thesis_lib.laws")
KINDS = (("EFFECT", "EFFECTS", Effect), ("LAW", "LAWS", Law))
REQUIRED = {"EFFECT": ("name", "family", "title", "equation", "parameters"), "LAW": ()}  # have no default
Say = Callable[[str], None]


def load(files: Iterable[str | Path] = (), *, data: Iterable[str | Path] = (), say: Say) -> list[dict[str, str]]:
    """Add effects and laws of installed packages and files to the library; return all additions for JSON.

    Args:
        files: paths of Python files.
        data: further folders in which the files must not lie.
        say: called with a note before a file runs.

    Raises:
        UserError: a file is missing, lies in a folder with data, fails, has no effect or law, or breaks a contract.
    """
    for loaded in (*installed(), *(read_file(path, data=data, say=say) for path in files)):
        require_free(loaded)
        require_contracts(loaded)
        add(loaded)
    return contents()


def read_file(path: str | Path, *, data: Iterable[str | Path] = (), say: Say) -> Loaded:
    """Run a file, and return the effects and laws that it defines; errors as in `load`."""
    path = Path(path)
    require_outside_of_data(path, data)
    if path.suffix != ".py":
        raise FileProblem(
            path, "is not a Python file (.py)", "give the file with your effects; --effect NAME takes a name"
        )
    if len(path.name) > MAX_NAME or not path.name.isprintable() or "\\" in path.name:
        raise FileProblem(path, "has a name that reports could not show", "rename it to a short, plain name")
    code = read_bytes(path, MAX_CODE)
    sha256 = hashlib.sha256(code).hexdigest()
    say(f"{path} is a program, which runs now with all your rights (SHA-256 {sha256[:12]}…)")
    module = _run(code, str(path), f"{path.stem}_{sha256[:12]}")
    return _held(module, Origin(sha256=sha256, file=path.name))


def require_outside_of_data(path: str | Path, data: Iterable[str | Path] = ()) -> None:
    """Reject a path inside a folder that holds a dataset, or inside one of the folders `data`, even through a link."""
    # as spelled, and where links lead; unlike Path.resolve, realpath survives a loop of links
    refused = {spelled for folder in data for spelled in (Path(folder).absolute(), Path(os.path.realpath(folder)))}
    for spelled in (Path(path).absolute(), Path(os.path.realpath(path))):
        for folder in spelled.parents:
            if folder in refused or holds_data(folder):
                raise UserError(
                    f"{path} lies in {folder}, a folder with data. Code out of a dataset never runs, because data may "
                    "come from strangers: read it, and copy it to a folder of your own if you trust it."
                )


def _run(code: bytes, filename: str, name: str) -> ModuleType:
    """Run the bytes that were read and hashed, even if the file has changed since; leaves no compiled copy."""
    if name in sys.modules:  # made from the same bytes
        return sys.modules[name]
    module = sys.modules[name] = ModuleType(name)  # classes look up their module there
    module.__file__ = filename
    try:
        with contextlib.redirect_stdout(sys.stderr):  # its output does not belong to the result
            exec(compile(code, filename, "exec", dont_inherit=True), module.__dict__)
    except (Exception, SystemExit) as error:  # a program can raise anything
        del sys.modules[name]
        raise UserError(f"{filename} cannot be loaded: {raised(error)}.") from error
    return module


def _held(module: ModuleType, origin: Origin) -> Loaded:
    """Effects and laws that a module binds; UserError if there are none, or the names are bound to other objects."""
    found: list[tuple] = []
    for one, several, kind in KINDS:
        values = _as_tuple(getattr(module, one, ())) + _as_tuple(getattr(module, several, ()))
        values = tuple(value for value in values if value is not LAWS and value is not EFFECTS)  # imported to build on
        for value in values:
            if not isinstance(value, kind):
                hint = "; create an instance with (): EFFECT = MyEffect()" if isinstance(value, type) else ""
                raise UserError(
                    f"{origin}: {one} or {several} is bound to {type(value).__name__!r}, not {kind.__name__}{hint}."
                )
            if missing := [name for name in REQUIRED[one] if not hasattr(value, name)]:
                raise UserError(f"{origin}: {type(value).__name__} lacks {', '.join(missing)}.")
        found.append(tuple(one for i, one in enumerate(values) if not any(one is other for other in values[:i])))
    if not any(found):
        raise UserError(
            f"{origin} binds none of EFFECT, EFFECTS, LAW and LAWS, so it adds nothing. "
            "thesis-lib effects --new NAME writes a file that does."
        )
    return Loaded(origin, *found)


def _as_tuple(value: object) -> tuple:
    return tuple(value) if isinstance(value, tuple | list) else (value,)


def results(loaded: Loaded, described: bool = True) -> Iterator[tuple[str, str, list[CheckResult]]]:
    """Kind, name and check results of each effect and law; `described`: also check their documentation."""
    for effect in loaded.effects:
        checks = [check for check in effect_contract.checks_of(effect) if described or not check.describes]
        yield "effect", effect.name, outcomes(checks, effect)
    for law in loaded.laws:
        yield "law", law.name, outcomes(law_contract.checks_of(law), law)


def require_contracts(loaded: Loaded) -> None:
    """Reject effects and laws that break a contract or do nothing; their documentation is not checked here."""
    for kind, name, found in results(loaded, described=False):
        for outcome in found:
            if outcome.verdict != "pass":
                fails = f"fails a check ({outcome.check})" if outcome.verdict == "FAIL" else "cannot be tested yet"
                raise UserError(
                    f"{loaded.origin}: the {kind} {name} {fails}: {outcome.reason}. "
                    "thesis-lib effects --check FILE.py prints the result of every check."
                )


# --- installed packages ---


def installed() -> list[Loaded]:
    """Effects and laws of installed packages, in the order of their names; UserError if one cannot be loaded."""
    found = []
    for distribution, offered in _offers():
        package, version = distribution.metadata["Name"], distribution.version
        if not (re.match(PACKAGE, package) and re.match(VERSION, version)):
            raise UserError(f"The installed package {package!r} {version!r} has an invalid name or version.")
        values: list[tuple[importlib.metadata.EntryPoint, object]] = []
        for point in sorted(offered, key=lambda point: (point.group, point.name)):
            try:
                values.append((point, point.load()))
            except (Exception, SystemExit) as error:
                raise UserError(
                    f"The installed package {package} {version} offers {point.name} to {point.group}, which cannot be "
                    f"loaded: {raised(error)}. Repair the package, or remove it: python -m pip uninstall {package}"
                ) from error
        sha256 = _code_sha256({point.module.partition(".")[0] for point in offered})
        origin = Origin(sha256=sha256, package=package, version=version)
        effects: list[Effect] = []
        laws: list[Law] = []
        for point, value in values:
            if not isinstance(value, ModuleType):
                held, value = value, ModuleType(point.name)
                value.__dict__["EFFECTS" if point.group == GROUPS[0] else "LAWS"] = _as_tuple(held)
            part = _held(value, origin)
            effects += part.effects
            laws += part.laws
        found.append(Loaded(origin, tuple(effects), tuple(laws)))
    return found


def _offers() -> list[tuple[importlib.metadata.Distribution, list[importlib.metadata.EntryPoint]]]:
    """Installed packages that offer effects or laws, by name; the current folder is not searched.

    That folder may hold a stranger's data together with files that look like an installed package.
    """
    here = os.path.realpath(os.curdir)
    path = [entry for entry in sys.path if entry and os.path.realpath(entry) != here and not holds_data(entry)]
    found: dict = {}
    for distribution in importlib.metadata.distributions(path=path):
        if offered := [point for point in distribution.entry_points if point.group in GROUPS]:
            # of two versions Python imports the first on the path
            found.setdefault(distribution.metadata["Name"], (distribution, offered))
    return [found[name] for name in sorted(found)]


def _code_sha256(modules: Iterable[str]) -> str:
    """Combined SHA-256 of the Python files of imported modules or packages, by name."""
    digest = hashlib.sha256()
    for name in sorted(modules):
        module = sys.modules[name]
        folders: Sequence[str] = list(getattr(module, "__path__", ()))
        files = [path for folder in folders for path in Path(folder).rglob("*.py")] or [Path(str(module.__file__))]
        for path in sorted(files):
            digest.update(f"{path.name}:{hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return digest.hexdigest()
