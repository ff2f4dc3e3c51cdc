"""What source code must not do with data from others, found in its syntax tree.

| rule    | what is found                                                                                      |
|---------|----------------------------------------------------------------------------------------------------|
| pickle  | modules and readers that run code from a file: pickle and its kin, marshal, shelve, HDF            |
| yaml    | loaders other than the safe ones                                                                   |
| torch   | `torch.load` without `weights_only=True`; `torch.hub`                                              |
| numpy   | `np.load` and friends with `allow_pickle`                                                          |
| eval    | `eval`, `exec`, `compile`, and expressions that pandas or SymPy evaluate, unless written in the source |
| code    | running a file of Python from outside the project                                                  |
| shell   | `os.system` and friends, `shell=True`, a subprocess whose command is one string                    |
| mktemp  | `tempfile.mktemp`: a name that another process can take first                                      |
| archive | unpacking to paths that the archive chooses                                                        |
| network | modules that open connections                                                                      |
| xml     | the XML parsers of the standard library, which unfold entities                                     |

Names are followed through imports and their aliases (`import numpy as np`, `from os import system as s`), not through
assignments: this finds slips, not somebody who hides.
"""

import ast
import io
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.imported_names import ImportedNames

RUN_CODE = {"pickle", "_pickle", "cPickle", "dill", "cloudpickle", "joblib", "shelve", "marshal", "jsonpickle"}
NETWORK = {
    *("urllib.request", "urllib3", "requests", "httpx", "aiohttp", "http.client", "http.server", "socket"),
    *("socketserver", "ftplib", "smtplib", "telnetlib", "paramiko", "xmlrpc", "websockets"),
}
XML = {"xml.etree", "xml.dom", "xml.sax", "lxml"}
READERS = {"read_pickle", "to_pickle", "read_hdf", "to_hdf"}
RUNS_FILES = {
    *("runpy.run_path", "runpy.run_module", "importlib.util.spec_from_file_location"),
    *("importlib.util.spec_from_loader", "importlib.machinery.SourceFileLoader", "imp.load_source"),
}
SHELLS = {
    *("os.system", "os.popen", "pty.spawn", "subprocess.getoutput", "subprocess.getstatusoutput"),
    *("asyncio.create_subprocess_shell", "commands.getoutput", "snakemake.shell.shell"),
}
SUBPROCESS = {f"subprocess.{name}" for name in ("run", "call", "check_call", "check_output", "Popen")}
YAML_TAKES_LOADER = {f"yaml.{name}" for name in ("load", "load_all", "parse", "compose", "compose_all", "scan")}
YAML_UNSAFE = {
    *(f"yaml.{name}" for name in ("unsafe_load", "unsafe_load_all", "full_load", "full_load_all")),
    *(f"yaml.{name}" for name in ("Loader", "UnsafeLoader", "FullLoader", "CLoader", "CFullLoader", "CUnsafeLoader")),
}
SAFE_LOADERS = {"SafeLoader", "CSafeLoader"}
UNPACK = {"extractall", "unpack_archive"}
EVALUATED = {"pandas.eval", "numexpr.evaluate", "sympy.sympify", "sympy.parsing.sympy_parser.parse_expr"}
SHELL_DIRECTIVE = re.compile(r"^\s*(shell|run|wrapper|notebook)\s*:", re.MULTILINE)


@dataclass(frozen=True, order=True)
class Finding:
    """A place in a file that breaks a rule."""

    path: str
    line: int
    rule: str
    what: str


def scan(source: str, path: str = "source.py") -> list[Finding]:
    """Findings in Python source, by line."""
    scanned = _Scan(path, ast.parse(source, filename=path))
    return sorted(set(scanned.findings()))


def scan_rules(source: str, path: str) -> list[Finding]:
    """Findings in a Snakemake file: commands that a shell would run, and what `scan` finds in its Python."""
    found = [
        Finding(path, source.count("\n", 0, match.start(1)) + 1, "shell", f"{match[1]}:")
        for match in SHELL_DIRECTIVE.finditer(source)
    ]
    python, lines = _python_of_rules(source)
    inside = [Finding(path, lines.get(f.line, 0), f.rule, f.what) for f in scan(python, path)]
    return sorted({*found, *inside})


def _python_of_rules(source: str) -> tuple[str, dict[int, int]]:
    """The Python that Snakemake makes of its rules, and the line of the source for each of its lines."""
    from snakemake.parser import parse

    class Text:
        def get_path_or_uri(self, **_: bool) -> str:
            return "Snakefile"

    class Workflow:
        class sourcecache:
            @staticmethod
            def open(_: Text) -> io.StringIO:
                return io.StringIO(source)

    lines: dict[int, int] = {}
    return parse(Text(), Workflow(), lines)[0], lines


class _Scan:
    def __init__(self, path: str, tree: ast.Module):
        self.path, self.tree = path, tree
        self.full_name = ImportedNames(tree).full
        self.assigned: dict[str, ast.expr] = {}  # module-level constants
        for node in tree.body:
            if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
                self.assigned[node.targets[0].id] = node.value

    def findings(self) -> Iterator[Finding]:
        for node in ast.walk(self.tree):
            if isinstance(node, ast.Import):
                for alias in node.names:
                    yield from self.imported(node, alias.name)
            elif isinstance(node, ast.ImportFrom) and node.module:
                for alias in node.names:
                    yield from self.imported(node, f"{node.module}.{alias.name}")
                    if f"{node.module}.{alias.name}" in YAML_UNSAFE:
                        yield self.finding(node, "yaml", f"{node.module}.{alias.name}")
            elif isinstance(node, ast.Attribute):
                name = self.full_name(node)
                if name in YAML_UNSAFE:
                    yield self.finding(node, "yaml", name)
                if node.attr in READERS:
                    yield self.finding(node, "pickle", node.attr)
                if name.startswith("torch.hub."):
                    yield self.finding(node, "torch", name)
            elif isinstance(node, ast.Call):
                yield from self.called(node)

    def finding(self, node: ast.AST, rule: str, what: str) -> Finding:
        return Finding(self.path, node.lineno, rule, what)

    def imported(self, node: ast.AST, name: str) -> Iterator[Finding]:
        for rule, modules in (("pickle", RUN_CODE), ("network", NETWORK), ("xml", XML)):
            if any(name == module or name.startswith(f"{module}.") for module in modules):
                yield self.finding(node, rule, name)

    def called(self, node: ast.Call) -> Iterator[Finding]:
        name = self.full_name(node.func)
        keywords = {keyword.arg: keyword.value for keyword in node.keywords}
        first = node.args[0] if node.args else keywords.get("args")
        last = name.rpartition(".")[2] or getattr(node.func, "attr", "")
        if name in ("importlib.import_module", "__import__") and isinstance(first, ast.Constant):
            yield from self.imported(node, str(first.value))
        if name in ("eval", "exec", "compile", "builtins.eval", "builtins.exec", "builtins.compile"):
            yield self.finding(node, "eval", name)
        written = isinstance(first, ast.Constant)
        if (name in EVALUATED or (last == "query" and _is_text(first))) and not written:
            yield self.finding(node, "eval", name or last)
        if name in RUNS_FILES or last == "exec_module":
            yield self.finding(node, "code", name or last)
        if name in SHELLS or re.fullmatch(r"os\.(exec|spawn|posix_spawn)\w*", name):
            yield self.finding(node, "shell", name)
        if "shell" in keywords and not _is(keywords["shell"], False):
            yield self.finding(node, "shell", "shell=")
        if name in SUBPROCESS and "shell" not in keywords and _is_text(first):
            yield self.finding(node, "shell", f"{name} of a string")
        if name == "tempfile.mktemp":
            yield self.finding(node, "mktemp", name)
        if last in UNPACK or (last == "extract" and "zip" in ast.unparse(node.func).lower()):
            yield self.finding(node, "archive", name or last)
        if name == "torch.load" and not _is(keywords.get("weights_only"), True):
            yield self.finding(node, "torch", name)
        if "allow_pickle" in keywords and not _is(keywords["allow_pickle"], False):
            yield self.finding(node, "numpy", "allow_pickle")
        if name == "numpy.load" and len(node.args) > 2:
            yield self.finding(node, "numpy", "allow_pickle by position")
        if name in YAML_TAKES_LOADER:
            loader = keywords.get("Loader", node.args[1] if len(node.args) > 1 else None)
            if not self.is_safe_loader(loader):
                yield self.finding(node, "yaml", name)

    def is_safe_loader(self, loader: ast.expr | None) -> bool:
        if isinstance(loader, ast.Name) and loader.id in self.assigned:
            loader = self.assigned[loader.id]
        if loader is None:
            return False
        named = {node.attr for node in ast.walk(loader) if isinstance(node, ast.Attribute)}
        named |= {self.full_name(node).rpartition(".")[2] for node in ast.walk(loader) if isinstance(node, ast.Name)}
        named |= {str(node.value) for node in ast.walk(loader) if isinstance(node, ast.Constant)}
        return bool(named & SAFE_LOADERS) and named <= {*SAFE_LOADERS, "getattr", "yaml"}


def _is(node: ast.expr | None, value: object) -> bool:
    return isinstance(node, ast.Constant) and node.value is value


def _is_text(node: ast.expr | None) -> bool:
    """Whether an expression is certainly one string and not a list of arguments."""
    if isinstance(node, ast.Constant):
        return isinstance(node.value, str)
    if isinstance(node, ast.Call):
        return isinstance(node.func, ast.Attribute) and node.func.attr in ("format", "join", "format_map")
    return isinstance(node, ast.JoinedStr) or (
        isinstance(node, ast.BinOp) and (_is_text(node.left) or _is_text(node.right))
    )


def python_files(root: Path, *folders: str) -> list[Path]:
    """Python files below `folders` of `root`, sorted."""
    return sorted(path for folder in folders for path in (root / folder).rglob("*.py"))
