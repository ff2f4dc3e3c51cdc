"""What every rule and script must have."""

import ast
import contextlib
import re
from importlib.util import find_spec

import pytest
from pipeline_copy import ROOT
from snakemake.api import SnakemakeApi
from snakemake.cli import parse_set_resources
from snakemake.iocontainers import InputFiles, Wildcards
from snakemake.settings.types import ConfigSettings, OutputSettings, Quietness, ResourceSettings

from thesis_lib.foundation.provenance import Sources
from thesis_lib.foundation.yaml_file import read_yaml
from thesis_lib.thesis.ledger.format import read_ledger

SCRIPTS = sorted((ROOT / "workflow/scripts").glob("*/*.py"))
MODULES = sorted((ROOT / "thesis_lib").rglob("*.py"))
LONGEST = 60  # lines of a script: more than that is work that belongs into the library
LOG = "from thesis_lib.thesis.job import snakemake"
GIVEN = ResourceSettings(cores=1, overwrite_resources=parse_set_resources(["claims:mem=7GB"]))
REQUESTS = read_yaml(ROOT / "config/resources.yaml").content


@pytest.fixture(scope="module")
def rules() -> list:
    """Rules that do something, as Snakemake has read them."""
    with contextlib.chdir(ROOT), SnakemakeApi(OutputSettings(quiet={Quietness.ALL})) as api:
        read = api.workflow(GIVEN, ConfigSettings(), snakefile=ROOT / "Snakefile", workdir=ROOT)._workflow
    return [rule for rule in read.rules if not rule.norun]


def any_of(rule) -> Wildcards:
    return Wildcards(fromdict=dict.fromkeys(rule.wildcard_names, "w"))


def test_every_rule_has_what_a_job_needs(rules):
    assert len(rules) > 40
    for rule in rules:
        wildcards = any_of(rule)
        name = "/".join([rule.name, *(["_".join("w" for _ in wildcards)] if wildcards else [])])
        assert rule.message and rule.conda_env and rule.output, rule.name
        assert rule.expand_log(wildcards) == [f"results/logs/{name}.log"]
        # times and memory are not results: they lie apart
        assert rule.expand_benchmark(wildcards) == f"results/logs/benchmarks/{name}.tsv"


def test_every_rule_carries_the_hash_of_its_own_script_and_every_script_is_used(rules):
    scripts = {rule.name: ROOT / "workflow/rules" / rule.script for rule in rules}
    assert {path.resolve() for path in scripts.values()} == set(SCRIPTS)
    sources = Sources(ROOT)
    assert {rule.name: rule.params["lib"] for rule in rules} == {
        name: sources.lib_hash(path.resolve()) for name, path in scripts.items()
    }


def test_every_rule_asks_for_what_it_was_measured_to_use_and_for_more_after_a_failure(rules):
    assert set(REQUESTS) == {rule.name for rule in rules}
    for rule in rules:
        asked = REQUESTS[rule.name]
        assert set(asked) == {"mem_mb", "runtime"} and min(asked.values()) > 0, rule.name
        for attempt in (1, 3):
            found = rule.expand_resources(any_of(rule), InputFiles(), attempt)
            memory = 7000 if rule.name == "claims" else attempt * asked["mem_mb"]  # a user's own request holds
            assert (found["mem_mb"], found["runtime"]) == (memory, attempt * asked["runtime"]), rule.name


def test_every_table_that_the_ledger_reads_is_made_by_a_rule(rules):
    outputs = [file for rule in rules for file in rule.output]
    named = {f"results/{claim.source.file}" for claim in read_ledger(ROOT / "config/claims").claims}
    assert [name for name in named if not any(file.match(name) for file in outputs)] == []


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
class TestScripts:
    def test_is_short_says_what_it_does_and_is_not_tied_to_a_place(self, script):
        text = script.read_text(encoding="utf-8")
        assert len(text.splitlines()) < LONGEST and "chdir" not in text
        assert ast.get_docstring(ast.parse(text))

    def test_opens_its_log_before_anything_else_can_fail(self, script):
        imports = [line for line in script.read_text(encoding="utf-8").split("\n") if "import " in line]
        assert next(line for line in imports if not re.match("from (functools|pathlib) ", line)) == LOG

    def test_computes_nothing_itself(self, script):
        tree = ast.parse(script.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.Import | ast.ImportFrom):
                names = [node.module or ""] if isinstance(node, ast.ImportFrom) else [a.name for a in node.names]
                for name in names:
                    assert name.split(".")[0] in {"functools", "pathlib", "thesis_lib"}, name
            if isinstance(node, ast.BinOp):
                # Path / "name" joins paths
                joins = isinstance(node.op, ast.Div) and isinstance(node.right, ast.Constant | ast.JoinedStr)
                assert joins, f"line {node.lineno}: {ast.unparse(node)}"
            assert not isinstance(node, ast.AugAssign | ast.While | ast.Lambda), ast.unparse(node)


class TestImportsThatTheHashMustSee:
    """`lib_hash` follows imports statically; these are the ways round it."""

    def test_names_are_imported_from_the_module_that_holds_them(self):
        """No relative imports, and no names that a package only forwards by name (`thesis_lib.datasets`)."""
        wrong = []
        for path in [*MODULES, *SCRIPTS]:
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if not isinstance(node, ast.ImportFrom):
                    continue
                if node.level:
                    wrong.append(f"{path}:{node.lineno}: relative import")
                if node.module == "thesis_lib.datasets":
                    forwarded = [a.name for a in node.names if not find_spec(f"thesis_lib.datasets.{a.name}")]
                    wrong += [f"{path}:{node.lineno}: import {name} from its module" for name in forwarded]
        assert wrong == []

    def test_imports_by_name_are_only_those_that_are_known(self):
        users = {
            path.relative_to(ROOT).as_posix()
            for path in MODULES
            if re.search(r"import_module\(|__import__\(", path.read_text(encoding="utf-8"))
        }
        assert users <= {
            "thesis_lib/datasets/__init__.py",
            "thesis_lib/effects/__init__.py",  # a registry: hashed as a whole folder
            "thesis_lib/critique/__init__.py",
            "thesis_lib/contact/__init__.py",  # laws of one's own: hashed as a whole folder
            "thesis_lib/thesis/records/catalogue.py",  # the same
            "thesis_lib/studies/docs/templates.py",  # no script imports it
            "thesis_lib/__main__.py",  # nor this
        }

    def test_the_library_does_not_know_snakemake(self):
        for path in MODULES:
            assert not re.search(r"^\s*(import|from) snakemake", path.read_text(encoding="utf-8"), re.MULTILINE)
