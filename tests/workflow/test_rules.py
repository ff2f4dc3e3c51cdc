"""What every rule and script must have, read from the files themselves."""

import ast
import re
from importlib.util import find_spec
from pathlib import Path

import pytest
from pipeline_copy import ROOT

from thesis_lib.foundation.yaml_file import read_yaml

RULE_FILES = sorted((ROOT / "workflow/rules").glob("*.smk"))
SCRIPTS = sorted((ROOT / "workflow/scripts").glob("*/*.py"))
MODULES = sorted((ROOT / "thesis_lib").rglob("*.py"))
LONGEST = 60  # lines of a script: more than that is work that belongs into the library
LOG = "sys.stdout = sys.stderr = open(snakemake.log[0]"


def rules() -> dict[str, str]:
    """Rule -> its text, for every rule that does something."""
    found = {}
    for path in RULE_FILES:
        parts = re.split(r"^(?:rule|checkpoint) (\w+):\n", path.read_text(encoding="utf-8"), flags=re.MULTILINE)
        for name, text in zip(parts[1::2], parts[2::2]):
            # a rule ends where a line is not indented
            body = re.split(r"^\S", text, maxsplit=1, flags=re.MULTILINE)[0]
            if re.search(r"^    (script|shell|run|notebook|wrapper):", body, re.MULTILINE):
                found[name] = body
    return found


RULES = rules()


def directive(rule: str, name: str) -> str | None:
    """Text of a directive of a rule, None where it has none."""
    match = re.search(rf"^    {name}:\n((?:        .*\n|\n)+)", RULES[rule], re.MULTILINE)
    return match and match[1]


@pytest.mark.parametrize("rule", RULES)
class TestRules:
    def test_has_what_every_rule_needs(self, rule):
        needed = ("log", "benchmark", "conda", "resources", "message", "script", "output")
        assert [name for name in needed if not directive(rule, name)] == []

    def test_runs_a_script_and_carries_the_hash_of_that_very_script(self, rule):
        path = re.search(r'"\.\./(scripts/\w+/\w+\.py)"', directive(rule, "script"))[1]
        assert (ROOT / "workflow" / path).is_file()
        script = Path(path).stem
        hashed = re.findall(r'lib=code_of\("(\w+)"\)', directive(rule, "params") or "")
        assert hashed == [script], f"rule {rule} must have lib=code_of({script!r}) among its params"

    def test_benchmark_has_the_name_of_the_log_in_its_own_folder(self, rule):
        """Times and memory are not results, and the path begins with the name of the rule."""
        log = re.search(r'"results/logs/(.+)\.log"', directive(rule, "log"))[1]
        (benchmark,) = re.findall(r'"(.+)"', directive(rule, "benchmark"))
        assert benchmark == f"results/logs/benchmarks/{log}.tsv"
        assert log.split("/")[0] == rule

    def test_asks_for_what_it_was_measured_to_use(self, rule):
        assert directive(rule, "resources").strip() == f'**needs("{rule}"),'


def test_every_rule_asks_for_memory_and_time_and_every_request_has_a_rule():
    requests = read_yaml(ROOT / "config/resources.yaml").content
    assert set(requests) == set(RULES)
    for rule, asked in requests.items():
        assert set(asked) == {"mem_mb", "runtime"} and min(asked.values()) > 0, rule


def test_every_script_is_used():
    used = {re.search(r"scripts/\w+/(\w+)\.py", directive(rule, "script"))[1] for rule in RULES}
    assert {path.stem for path in SCRIPTS} == used


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
class TestScripts:
    def test_is_short_says_what_it_does_and_is_not_tied_to_a_place(self, script):
        text = script.read_text(encoding="utf-8")
        assert len(text.splitlines()) < LONGEST and "chdir" not in text
        assert ast.get_docstring(ast.parse(text))

    def test_opens_its_log_before_anything_else_can_fail(self, script):
        statements = ast.parse(script.read_text(encoding="utf-8")).body
        first = [ast.unparse(node) for node in statements[1:3]]
        assert first[0] == "import sys" and first[1].startswith(LOG)

    def test_computes_nothing_itself(self, script):
        tree = ast.parse(script.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.Import | ast.ImportFrom):
                names = [node.module or ""] if isinstance(node, ast.ImportFrom) else [a.name for a in node.names]
                for name in names:
                    assert name.split(".")[0] in {"sys", "functools", "pathlib", "thesis_lib"}, name
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
            "thesis_lib/thesis/ledger/__init__.py",
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
