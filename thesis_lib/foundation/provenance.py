"""Code, versions and data that produced a result.

`lib_hash` is the part that Snakemake cannot see: a hash of the modules of thesis_lib that a script uses, directly or
through other modules. Rules have it as a parameter, so that an edit reruns exactly the rules that use the edited
module; comments, layout, docstrings, the place of a module and `__version__` do not count. Imports are followed
statically, also inside functions. A module that lists its folder (`pkgutil.iter_modules`), as registries do, uses all
modules and YAML files in it. If an import only passes a package on the way to a module, the `__init__` of the package
counts, but not the imports in it. The parsed parts of a module are stored beside the byte code, under the SHA-256 of
its text, since most modules do not change between runs.
"""

import ast
import functools
import hashlib
import json
import os
import platform
import subprocess
import sys
from collections.abc import Iterable
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

from thesis_lib.foundation.kernels import processor

PACKAGE = "thesis_lib"
KEPT = "code_hashes.json"  # in the __pycache__ of the package
LISTING = ("iter_modules", "walk_packages")  # functions of pkgutil
READER = 3  # version of the parser; stored results of other versions are discarded
MOST_KEPT = 5000  # stored modules, of several versions
DATA_SUFFIXES = (".mplstyle", ".txt", ".html", ".css", ".js")  # data files that modules of a folder read


def lib_hash(script: str | Path, root: str | Path | None = None) -> str:
    """Hash (16 hex digits) of a script and of every module of thesis_lib that it uses.

    Moving a module and changing the imports that name it leaves the hash as it was.  `root` is the folder that holds
    the package, by default the parent of this package.  For many scripts, `Sources` reads each module only once.
    """
    return Sources(root).lib_hash(script)


class Sources:
    """The current package below `root`: each module is read only once, however many scripts use it."""

    def __init__(self, root: str | Path | None = None) -> None:
        self.root = Path(root) if root else Path(__file__).resolve().parents[2]
        # caches of this object, not of the class: a new object reads the files again
        self._read = functools.cache(self._read_file)
        self._module_file = functools.cache(functools.partial(_module_file, root=self.root))
        self._hashed = functools.cache(self._hash_file)
        self._store = self.root / PACKAGE / "__pycache__" / KEPT
        self._kept = _load(self._store)
        self._new = False

    def lib_hash(self, script: str | Path) -> str:
        """Hash of a script and of the modules that it uses, as in the function `lib_hash`."""
        first = Path(script)
        found: dict[Path, _Used] = {}
        queue = [first]
        while queue:
            if (path := queue.pop()) not in found:
                found[path] = self._hashed(path)
                queue += found[path].files
        if self._new:
            _save(self._store, self._kept)
            self._new = False
        others = {one.hash for path, one in found.items() if path != first}
        used = sorted(others.union(*(one.passed for one in found.values())))
        return hashlib.sha256("\n".join([found[first].hash, *used]).encode()).hexdigest()[:16]

    def _read_file(self, path: Path) -> "_Module":
        """Parts of a module that are hashed, from the store or read now."""
        content = path.read_bytes()
        key = hashlib.sha256(content).hexdigest()
        if key not in self._kept:
            self._kept[key], self._new = _read_module(content.decode("utf-8"), str(path)), True
        return self._kept[key]

    def _hash_file(self, path: Path) -> "_Used":
        if path.suffix != ".py":
            return _Used(file_sha256(path), (), ())
        module = self._read(path)
        names = {*module.modules, *(f"{path}.{name}" for path, name in module.imports)}
        files = {file for name in names if (file := self._module_file(name) or self._module_file(_packages(name)[-1]))}
        if module.looks_around:
            files.update(file for pattern in ("*.py", "*/__init__.py", "*.yaml") for file in path.parent.glob(pattern))
        on_the_way = {self._module_file(package) for name in names for package in _packages(name)}
        passed = {self._read(package).digest for package in on_the_way if package and package not in files}
        beside = (file for file in path.parent.iterdir() if file.suffix in DATA_SUFFIXES)
        return _Used(self._hash_with_imports(module), (*files, *beside), tuple(passed))

    def _hash_with_imports(self, module: "_Module") -> str:
        """Hash of a module's code, with the path of each import replaced by the imported code."""
        digest = hashlib.sha256(module.digest.encode())
        for path, name in module.imports:
            inner = self._module_file(f"{path}.{name}")  # the name of an imported module is part of its path
            file = inner or self._module_file(path)
            code = self._read(file).digest if file else hashlib.sha256(path.encode()).hexdigest()
            digest.update(f"\n{'' if inner else name}:{code}".encode())
        return digest.hexdigest()


class _Used(NamedTuple):
    """Hash of a file, the files that it uses, and the hashes of the packages that its imports pass on their way."""

    hash: str
    files: tuple[Path, ...]
    passed: tuple[str, ...]


class _Module(NamedTuple):
    """Parts of a module that are hashed.

    `digest` is the SHA-256, as hex digits, of its code without docstrings, comments and layout, where `from ... import`
    from the package is `_IMPORT`, without its path; `imports` are (path, name) of these, in their order there;
    `modules` are named by `import ...`, with their packages.  It `looks_around` if it lists the modules of its folder.
    """

    digest: str
    imports: tuple[tuple[str, str], ...]
    modules: tuple[str, ...]
    looks_around: bool


_IMPORT = "import from the package"


def _read_module(text: str, filename: str) -> _Module:
    tree = ast.parse(text, filename=filename)
    modules: list[str] = []
    imports: list[tuple[str, str]] = []
    looks_around = False
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            of_package = (alias.name for alias in node.names if alias.name.split(".")[0] == PACKAGE)
            modules += [module for name in of_package for module in (*_packages(name), name)]
        elif isinstance(node, ast.Call):
            looks_around |= getattr(node.func, "attr", getattr(node.func, "id", None)) in LISTING
        _strip_docstring(node)
        for field in ("body", "orelse", "finalbody"):
            block = getattr(node, field, None)
            if isinstance(block, list):
                setattr(node, field, _without_paths(block, imports))
    digest = hashlib.sha256(ast.dump(tree).encode()).hexdigest()
    return _Module(digest, tuple(imports), tuple(dict.fromkeys(modules)), looks_around)


def _packages(name: str) -> list[str]:
    """The packages that contain the object with this dotted name, the outermost first."""
    parts = name.split(".")
    return [".".join(parts[:i]) for i in range(1, len(parts))]


def _load(path: Path) -> dict[str, _Module]:
    """Modules by the SHA-256 of their text, as stored by `_save`; none if the store cannot be read."""
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        if kept["reader"] != [READER, sys.version]:
            return {}
        return {
            key: _Module(digest, tuple((path, name) for path, name in imports), tuple(modules), looks_around)
            for key, (digest, imports, modules, looks_around) in kept["modules"].items()
        }
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}


def _save(path: Path, modules: dict[str, _Module]) -> None:
    """Store the modules; if the store cannot be written, they are read again the next time."""
    while len(modules) > MOST_KEPT:
        modules.pop(next(iter(modules)))  # the oldest
    tmp = path.with_name(f"{path.name}.{os.getpid()}")
    try:
        path.parent.mkdir(exist_ok=True)
        tmp.write_text(json.dumps({"reader": [READER, sys.version], "modules": modules}), encoding="utf-8")
        tmp.replace(path)
    except OSError:
        tmp.unlink(missing_ok=True)


def _without_paths(block: list[ast.stmt], imports: list[tuple[str, str]]) -> list[ast.stmt]:
    """The block with imports from the package reduced to the names that they bind; their paths go into `imports`.

    Adjacent imports are sorted by these names, because their order in the file follows the paths.
    """
    out: list[ast.stmt] = []
    run: list[tuple[str, str, str]] = []  # name that is bound, name in the module, its path

    def close() -> None:
        for bound, name, path in sorted(run):
            imports.append((path, name))
            out.append(ast.Expr(ast.Constant(f"{_IMPORT}: {bound}")))
        run.clear()

    for node in block:
        if isinstance(node, ast.ImportFrom) and node.level == 0 and (node.module or "").split(".")[0] == PACKAGE:
            run += [(alias.asname or alias.name, alias.name, node.module or "") for alias in node.names]
        else:
            close()
            if not _is_version(node):
                out.append(node)
    close()
    return out


def _is_version(node: ast.stmt) -> bool:
    """Whether a statement sets the number of a release, which changes no result."""
    return isinstance(node, ast.Assign) and [getattr(name, "id", "") for name in node.targets] == ["__version__"]


def _module_file(name: str, root: Path) -> Path | None:
    """The file of a module or a package; None for a name within a module."""
    path = root.joinpath(*name.split("."))
    return next((file for file in (path.with_suffix(".py"), path / "__init__.py") if file.is_file()), None)


def _strip_docstring(node: ast.AST) -> None:
    body = getattr(node, "body", None)
    if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and body:
        first = body[0]
        if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
            node.body = body[1:] or [ast.Pass()]


def file_sha256(path: str | Path) -> str:
    """SHA-256 of a file as hex digits."""
    with Path(path).open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def folder_sha256(folder: str | Path) -> str:
    """One SHA-256 over names and contents of all files below a folder, as hex digits."""
    return _sha256_of(Path(folder).rglob("*"), Path(folder))


def _sha256_of(paths: Iterable[Path], root: Path) -> str:
    """One SHA-256 over names, relative to `root`, and contents of those paths that are files."""
    digest = hashlib.sha256()
    for path in sorted(path for path in paths if path.is_file()):
        digest.update(f"{path.relative_to(root).as_posix()}:{file_sha256(path)}\n".encode())
    return digest.hexdigest()


def code_sha256(root: str | Path) -> str:
    """One SHA-256 over the source of a checkout: Snakefile, and all of thesis_lib and workflow except caches."""
    root = Path(root)
    files = [root / "Snakefile", *(p for name in (PACKAGE, "workflow") for p in (root / name).rglob("*"))]
    return _sha256_of((path for path in files if "__pycache__" not in path.parts), root)


def value_sha256(value: object) -> str:
    """SHA-256 of a value that JSON can represent, independent of the order of keys."""
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


def environment(requirements: str | Path) -> dict:
    """The environment of a run, which also affects the bits of a result.

    `requirements`, in the root of the checkout, has a line `name==version` for each direct dependency.  The keys are
    `python`, `platform`, `processor` (model, and vector instructions that determine kernels), `blas` (library, version
    and kernel of each in NumPy and SciPy), `packages` (all installed ones, and required ones that are missing),
    `commit`, `local_changes` (null outside a git checkout) and `code` (SHA-256).
    """
    root = Path(requirements).resolve().parent
    lines = Path(requirements).read_text(encoding="utf-8").splitlines()
    pinned = [line.split("==")[0].strip() for line in lines if "==" in line and not line.startswith("#")]
    installed = {package.metadata["Name"]: package.version for package in metadata.distributions()}
    packages = installed | {name: _version(name) for name in pinned}
    machine = {"platform": platform.platform(), "processor": processor(), "blas": _blas()}
    python = sys.version.split()[0]
    return {"python": python, **machine, "packages": packages, **_commit(root), "code": code_sha256(root)}


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "not installed"


def _blas() -> list[dict]:
    import numpy as np  # noqa: F401
    import scipy.linalg  # noqa: F401
    from threadpoolctl import threadpool_info

    libraries = []
    for found in threadpool_info():
        if found["user_api"] == "blas":
            of = Path(found["filepath"]).parent.name.removesuffix(".libs")
            kernel = {"version": found["version"], "kernel": found.get("architecture")}
            libraries.append({"of": of, "library": found["internal_api"], **kernel})
    return sorted(libraries, key=lambda library: (library["of"], str(library["version"])))


def _commit(folder: Path) -> dict:
    try:
        commit = _git(folder, "rev-parse", "HEAD")
        return {"commit": commit, "local_changes": bool(_git(folder, "status", "--porcelain"))}
    except (OSError, subprocess.CalledProcessError):
        return {"commit": "unknown (not a git checkout)", "local_changes": None}


def _git(folder: Path, *arguments: str) -> str:
    done = subprocess.run(["git", "-C", str(folder), *arguments], capture_output=True, text=True, check=True)
    return done.stdout.strip()
