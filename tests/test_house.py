"""The contributor's pages say what is: paths, commands, imports between packages, references, tools."""

import ast
import functools
import re
import tomllib
from collections import Counter
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
import yaml

import thesis_lib
from thesis_lib.datasets.sources.published import SOURCES

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "thesis_lib"
PAGES = ("CONTRIBUTING.md", "docs/architecture.md", "CHANGELOG.md")
TEXT = {page: (ROOT / page).read_text(encoding="utf-8") for page in PAGES}
FOLDERS = "thesis_lib|config|tests|workflow|docs|profiles|benchmarks|\\.ci"
WINGS = ("thesis", "jenga", "studies")  # beside the library; pip installs none of them
PACKAGES = sorted(path.parent.name for path in PACKAGE.glob("*/__init__.py"))  # the uppermost rooms


def named_paths(text: str) -> set[str]:
    """Paths of the repository in code spans, those in folders that git holds."""
    return set(re.findall(rf"`((?:{FOLDERS})/[^`\s]*)`", text))


@pytest.mark.parametrize("page", PAGES)
def test_paths_exist(page):
    paths = sorted(path for path in named_paths(TEXT[page]) if "<" not in path)
    assert [path for path in paths if not any(ROOT.glob(path.rstrip("/")))] == []


def test_enough_paths_are_named():
    assert len(named_paths(TEXT["CONTRIBUTING.md"])) > 50 and len(named_paths(TEXT["docs/architecture.md"])) > 20


def test_every_package_stands_in_the_map():
    for name in set(PACKAGES) - {"bodies", "foundation", "statistics"}:  # the concern of few
        assert f"thesis_lib/{name}/" in TEXT["CONTRIBUTING.md"], f"CONTRIBUTING.md: where to change {name}?"


def test_modules_named_in_commands_exist():
    for page in PAGES:
        for name in re.findall(r"python -m (thesis_lib[\w.]*)", TEXT[page]):
            path = ROOT / name.replace(".", "/")
            assert path.with_suffix(".py").exists() or (path / "__main__.py").exists(), f"{page}: {name}"


# --- imports between rooms ---

MODULES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for path in PACKAGE.rglob("*.py")
}


@functools.cache
def imports_of(module: str) -> frozenset[str]:
    """Modules of thesis_lib that a module imports, also within functions."""
    names = set()
    for node in ast.walk(ast.parse(MODULES[module].read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            names |= (inner & set(MODULES)) or {node.module}
        elif isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
    return frozenset((names & set(MODULES)) - {module})


def room(module: str) -> str:
    """The folder in which a module stands, as `critique.drops`; "" directly in thesis_lib."""
    return ".".join(MODULES[module].parent.relative_to(PACKAGE).parts)


def imported_rooms(name: str) -> set[str]:
    found = {room(used) for module in MODULES if room(module) == name for used in imports_of(module)}
    return found - {name, "foundation", "statistics", "mechanics", ""}


def said_rooms() -> dict[str, list[str]]:
    """Room -> those that it imports from, in the order of the architecture's tables."""
    section = TEXT["docs/architecture.md"].split("## The packages of")[1].split("\n## ")[0]
    rows = re.findall(r"^\| `([\w.]+)` \|[^|]+\|([^|]*)\|$", section, re.M)
    return {name: re.findall(r"[\w.]+", uses) for name, uses in rows}


def test_the_table_of_rooms_is_complete_and_in_order():
    said = said_rooms()
    assert set(said) == {room(module) for module in MODULES} - {""}
    order = list(said)
    for name, uses in said.items():
        assert all(order.index(used) < order.index(name) for used in uses), f"{name} imports from a room below it"


@pytest.mark.parametrize("name", said_rooms())
def test_imports_are_those_of_the_table(name):
    found, said = imported_rooms(name), set(said_rooms()[name])
    assert found == said, f"{name}: new {found - said}, gone {said - found}; is it meant? docs/architecture.md"


def test_the_library_imports_nothing_of_the_other_wings():
    """What `pip install .` leaves out; the order of the tables holds the other wings apart."""
    outside = {module for module in MODULES if room(module).split(".")[0] in WINGS}
    found = {module: sorted(imports_of(module) & outside) for module in set(MODULES) - outside}
    assert {module: names for module, names in found.items() if names} == {}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    left_out = project["tool"]["setuptools"]["packages"]["find"]["exclude"]
    assert sorted(left_out) == sorted(f"thesis_lib.{wing}*" for wing in WINGS)


def test_no_files_import_each_other():
    graph = {module: imports_of(module) for module in MODULES}
    TopologicalSorter(graph).prepare()  # CycleError names the files


def test_rooms_use_no_command_line_and_no_configuration():
    """They look into the rooms; of these only `studies.docs` looks back, at the configuration."""
    above = {"thesis_lib.__main__", "thesis_lib.thesis.config", "thesis_lib.thesis.pipeline"}
    for module in set(MODULES) - above:
        if top := imports_of(module) & above:
            assert (room(module), top) == ("studies.docs", {"thesis_lib.thesis.config"}), f"{module} imports {top}"


# --- size of rooms ---

MOST_MODULES = 20  # in a folder: more are several concepts
LARGE_ROOMS = {"effects"}  # a registry: each file is one member


def test_rooms_hold_few_modules():
    sizes = Counter(room(module) for module in MODULES)
    assert {name for name, size in sizes.items() if size > MOST_MODULES} <= LARGE_ROOMS


# --- names ---

# the world of the search, and that of compiled code: kernels that numba keeps on disk hold the name of the class
SAME_NAMES = {"World"}


def test_each_noun_is_one_class():
    """A public class of `thesis_lib` has a name of its own, so that a reader need not ask which one is meant."""
    places: dict[str, list[str]] = {}
    for module, path in MODULES.items():
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places.setdefault(node.name, []).append(module)
    assert {name: modules for name, modules in places.items() if len(modules) > 1 and name not in SAME_NAMES} == {}


def test_files_of_tests_have_names_of_their_own():
    """pytest imports the files by their base names, and cannot collect two of the same name together."""
    names = Counter(path.name for path in (ROOT / "tests").rglob("test_*.py"))
    assert [name for name, count in names.items() if count > 1] == []


# --- files that other tools read ---


def test_citation_names_the_data_that_are_fetched():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    cited = {
        f"{r['repository-code'].removeprefix('https://github.com/')}/{r['commit']}"
        for r in citation["references"]
        if r["type"] == "data"
    }
    fetched = {"/".join(path.split("/")[:3]) for source in SOURCES.values() for path in source.raw.values()}
    fetched |= {"/".join(source.archive) for source in SOURCES.values() if source.archive}
    assert cited <= fetched
    assert {name.rsplit("/", 1)[0] for name in fetched} == {name.rsplit("/", 1)[0] for name in cited}


def test_versions_and_licence_agree():
    pyproject = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    project, dynamic = pyproject["project"], pyproject["tool"]["setuptools"]["dynamic"]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert dynamic["version"] == {"attr": "thesis_lib.__version__"} and project["dynamic"] == ["version"]
    assert citation["version"] == thesis_lib.__version__
    assert citation["license"] == project["license"] == "MIT"
    assert (ROOT / "LICENSE").read_text(encoding="utf-8").startswith("MIT License")


def test_changelog_keeps_its_format():
    """https://keepachangelog.com: newest first, known kinds of change, no empty section."""
    sections = re.findall(r"^## \[(.+?)\](.*)$", TEXT["CHANGELOG.md"], re.M)
    releases = [section for section in sections if section[0] != "Unreleased"]
    assert sections[-len(releases) :] == releases and releases[0][0] == thesis_lib.__version__
    assert all(re.fullmatch(r" - \d{4}-\d{2}-\d{2}", date) for _, date in releases)
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert releases[0][1] == f" - {citation['date-released']}"
    kinds = re.split(r"^### ", TEXT["CHANGELOG.md"], flags=re.M)[1:]
    for kind in kinds:
        title, *lines = kind.splitlines()
        assert title in {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}
        assert any(line.startswith("- ") for line in lines), f"{title} is empty"


def test_pre_commit_downloads_nothing_and_checks_what_make_check_does():
    content = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8"))
    assert [repo["repo"] for repo in content["repos"]] == ["local"]
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for hook in content["repos"][0]["hooks"]:
        assert hook["language"] == "system" and hook["entry"].startswith(".venv/bin/")
        tool, *words = hook["entry"].removeprefix(".venv/bin/").split()
        command = " ".join([tool, *(word for word in words if word != "--force-exclude")])
        assert f"$(BIN)/{command}" in makefile, command
