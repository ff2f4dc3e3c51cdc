"""`lib_hash`: changes with the code that a script uses, and with nothing else."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from thesis_lib.foundation.provenance import (
    KEPT,
    code_sha256,
    environment,
    file_sha256,
    folder_sha256,
    lib_hash,
    value_sha256,
)

FILES = {
    "thesis_lib/__init__.py": "",
    "thesis_lib/plain.py": '"""Text."""\nX = 1\n',
    "thesis_lib/unused.py": "Y = 1\n",
    "thesis_lib/contact/__init__.py": "import pkgutil\nLAWS = [*pkgutil.iter_modules(__path__)]\n",  # a registry
    "thesis_lib/contact/law.py": "from thesis_lib.deep import below\nLAW = below.Z\n",
    "thesis_lib/deep/__init__.py": "",
    "thesis_lib/deep/below.py": "Z = 3\n",
    "thesis_lib/late.py": "W = 4\n",
    "thesis_lib/figures/__init__.py": "",
    "thesis_lib/figures/style.py": "S = 5\n",
    "thesis_lib/figures/print.mplstyle": "lines.linewidth: 1\n",
    "plain.py": "import thesis_lib.plain\nprint(thesis_lib.plain.X)\n",
    "law.py": "from thesis_lib.contact import law\n",
    "laws.py": "from thesis_lib.contact import LAWS\n",
    "laws_late.py": "def f():\n    from thesis_lib import contact\n    return contact.LAWS\n",
    "late.py": "def f():\n    from thesis_lib.late import W\n    return W\n",
    "figures.py": "from thesis_lib.figures.style import S\n",
}
SCRIPTS = ("plain", "law", "laws", "laws_late", "late", "figures")


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A small package and scripts that use parts of it."""
    for name, content in FILES.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content, encoding="utf-8")
    return tmp_path


def hashes(root: Path) -> dict[str, str]:
    return {name: lib_hash(root / f"{name}.py", root) for name in SCRIPTS}


def changed_by(root: Path, path: str, content: str) -> set[str]:
    """Scripts whose hash changes when a file gets this content."""
    before = hashes(root)
    (root / path).parent.mkdir(exist_ok=True)
    (root / path).write_text(content, encoding="utf-8")
    after = hashes(root)
    return {name for name in SCRIPTS if before[name] != after[name]}


@pytest.mark.parametrize(
    "content",
    ["# a comment\nX = 1\n", '"""Another text, over\ntwo lines."""\n\n\nX = 1  # unit\n', "X = (\n    1\n)\n", "X = 1"],
)
def test_comments_docstrings_and_layout_do_not_count(root, content):
    assert changed_by(root, "thesis_lib/plain.py", content) == set()


def test_docstrings_of_functions_and_classes_do_not_count(root):
    code = "def f(x):\n    {}\n    return x\nclass A:\n    {}\n    y = 1\n"
    (root / "thesis_lib/plain.py").write_text(code.format('"""Old."""', '"""Old."""'))
    assert changed_by(root, "thesis_lib/plain.py", code.format('"""New."""', '"""Newer."""')) == set()
    assert changed_by(root, "thesis_lib/plain.py", code.format("x = 2", '"""New."""')) == {"plain"}


@pytest.mark.parametrize(
    ("path", "content", "users"),
    [
        ("thesis_lib/plain.py", "X = 2\n", {"plain"}),
        ("thesis_lib/plain.py", "X = '1'\n", {"plain"}),
        ("thesis_lib/unused.py", "Y = 2\n", set()),
        ("thesis_lib/late.py", "W = 5\n", {"late"}),
        ("thesis_lib/deep/below.py", "Z = 4\n", {"law", "laws", "laws_late"}),
        ("thesis_lib/deep/__init__.py", "import os\n", {"law", "laws", "laws_late"}),
        ("thesis_lib/__init__.py", "import os\n", set(SCRIPTS)),
        ("thesis_lib/__init__.py", '__version__ = "2.0"\n', set()),
        ("thesis_lib/figures/print.mplstyle", "lines.linewidth: 2\n", {"figures"}),
        ("thesis_lib/contact/new_law.py", "LAW = 1\n", {"laws", "laws_late"}),
        ("thesis_lib/contact/kind/__init__.py", "LAW = 1\n", {"laws", "laws_late"}),
        ("thesis_lib/contact/said.yaml", "title: law\n", {"laws", "laws_late"}),
        ("thesis_lib/deep/new.py", "V = 1\n", set()),  # no registry
        ("thesis_lib/deep/new.yaml", "v: 1\n", set()),
        ("plain.py", "import thesis_lib.plain\nprint(2 * thesis_lib.plain.X)\n", {"plain"}),
    ],
)
def test_an_edit_changes_exactly_the_users(root, path, content, users):
    assert changed_by(root, path, content) == users


def test_new_import_of_a_used_module_is_followed(root):
    assert changed_by(root, "thesis_lib/plain.py", "from thesis_lib import unused\nX = 1\n") == {"plain"}
    assert changed_by(root, "thesis_lib/unused.py", "Y = 3\n") == {"plain"}


def test_what_a_package_imports_reaches_those_that_use_the_package_itself(root):
    registry = "from thesis_lib import unused\n" + FILES["thesis_lib/contact/__init__.py"]
    assert changed_by(root, "thesis_lib/contact/__init__.py", registry) == {"law", "laws", "laws_late"}
    assert changed_by(root, "thesis_lib/unused.py", "Y = 3\n") == {"laws", "laws_late"}


def test_a_module_that_moves_changes_nothing(root):
    (root / "thesis_lib/plain.py").write_text("from thesis_lib.deep import below\nfrom thesis_lib.late import W\n")
    before = hashes(root)
    (root / "thesis_lib/archive").mkdir()
    (root / "thesis_lib/archive/__init__.py").write_text("")
    (root / "thesis_lib/late.py").rename(root / "thesis_lib/archive/former.py")
    (root / "late.py").write_text(FILES["late.py"].replace("thesis_lib.late", "thesis_lib.archive.former"))
    (root / "thesis_lib/deep/below.py").rename(root / "thesis_lib/archive/under.py")
    moved = "from thesis_lib.archive.former import W\nfrom thesis_lib.archive import under as below\n"
    (root / "thesis_lib/plain.py").write_text(moved)
    (root / "thesis_lib/contact/law.py").write_text(
        FILES["thesis_lib/contact/law.py"].replace("deep import below", "archive import under as below")
    )
    assert hashes(root) == before


def test_an_import_of_the_same_name_from_another_module_counts(root):
    (root / "thesis_lib/unused.py").write_text("W = 5\n")
    (root / "late.py").write_text(FILES["late.py"] + "import thesis_lib.unused\n")
    before = hashes(root)
    (root / "late.py").write_text((root / "late.py").read_text().replace("thesis_lib.late", "thesis_lib.unused"))
    assert {name for name in SCRIPTS if hashes(root)[name] != before[name]} == {"late"}


def test_hash_does_not_depend_on_where_the_checkout_lies(root, tmp_path_factory):
    other = tmp_path_factory.mktemp("zz") / "elsewhere"
    root.rename(other)
    moved = hashes(other)
    other.rename(root)
    assert moved == hashes(root)


def test_what_was_kept_gives_the_same_hashes(root):
    kept = root / "thesis_lib/__pycache__" / KEPT
    read = hashes(root)
    assert len(json.loads(kept.read_text(encoding="utf-8"))["modules"]) == 13  # texts; some are equal, one is unused
    assert hashes(root) == read
    for spoilt in (kept.read_text(encoding="utf-8")[:-9], "[]", '{"reader": 1}', "\xff"):
        kept.write_text(spoilt, encoding="latin-1")
        assert hashes(root) == read
    kept.unlink()
    kept.mkdir()  # nothing can be kept
    assert hashes(root) == read
    assert [path.name for path in kept.parent.iterdir()] == [KEPT]


def test_a_kept_module_is_found_by_its_text_alone(root):
    before = hashes(root)
    file = root / "thesis_lib/plain.py"
    stamp = file.stat().st_mtime_ns
    file.write_text('"""Text."""\nX = 2\n', encoding="utf-8")
    os.utime(file, ns=(stamp, stamp))
    assert {name for name, value in hashes(root).items() if value != before[name]} == {"plain"}


def test_broken_module_is_named(root):
    (root / "thesis_lib/plain.py").write_text("X = \n")
    with pytest.raises(SyntaxError) as caught:
        lib_hash(root / "plain.py", root)
    assert caught.value.filename.endswith("plain.py")


def test_file_sha256(tmp_path):
    (tmp_path / "abc").write_bytes(b"abc")
    assert file_sha256(tmp_path / "abc").startswith("ba7816bf8f01cfea414140de5dae2223")  # FIPS 180-2, B.1


def test_code_sha256_sees_every_source_and_no_cache(root):
    (root / "Snakefile").write_text("rule all:\n")
    (root / "workflow").mkdir()
    seen = [code_sha256(root)]
    for name in ("Snakefile", "workflow/a.smk", "thesis_lib/plain.py", "thesis_lib/figures/print.mplstyle"):
        (root / name).write_text("# changed\n")
        seen.append(code_sha256(root))
    assert len(set(seen)) == 5
    (root / "thesis_lib" / "__pycache__").mkdir()
    (root / "thesis_lib" / "__pycache__" / "plain.pyc").write_text("x")
    (root / "plain.py").write_text("X = 9\n")
    assert code_sha256(root) == seen[-1]


def test_value_sha256_does_not_depend_on_the_order_of_keys():
    assert value_sha256({"a": 1, "b": [2, None]}) == value_sha256({"b": [2, None], "a": 1})
    assert value_sha256({"a": 1}) != value_sha256({"a": 2})


def test_folder_sha256_follows_names_and_contents_not_places(tmp_path):
    for name in ("a", "b"):
        (tmp_path / name / "deep").mkdir(parents=True)
        (tmp_path / name / "deep" / "one.csv").write_text("1")
        (tmp_path / name / "two.csv").write_text("2")
    first = folder_sha256(tmp_path / "a")
    assert first == folder_sha256(tmp_path / "b")
    (tmp_path / "b" / "two.csv").rename(tmp_path / "b" / "three.csv")
    assert folder_sha256(tmp_path / "b") != first
    (tmp_path / "a" / "two.csv").write_text("3")
    assert folder_sha256(tmp_path / "a") != first


class TestEnvironment:
    @pytest.fixture
    def requirements(self, tmp_path: Path) -> Path:
        path = tmp_path / "environment.txt"
        path.write_text("# pins\nnumpy==0.0\nno-such-package==1.0\n\n")
        return path

    def test_installed_versions_not_the_pinned_ones(self, requirements):
        import numpy as np

        packages = environment(requirements)["packages"]
        assert packages["numpy"] == np.__version__ and packages["no-such-package"] == "not installed"
        # what dependencies bring along counts, too
        assert {"scipy", "pydantic_core", "contourpy"} <= set(packages)

    def test_machine_and_blas_are_told_without_paths(self, requirements):
        found = environment(requirements)
        assert found["processor"]["model"] and "/" not in json.dumps(found["blas"])
        assert {one["of"] for one in found["blas"]} >= {"numpy"}
        assert all(one["library"] and one["version"] and one["kernel"] for one in found["blas"])

    def test_the_kernel_is_the_one_in_use(self):
        code = "from thesis_lib.foundation.provenance import _blas; print({one['kernel'] for one in _blas()})"
        done = subprocess.run(
            [sys.executable, "-c", code],
            env=os.environ | {"OPENBLAS_CORETYPE": "Nehalem"},
            capture_output=True,
            text=True,
            check=True,
        )
        assert done.stdout.strip() == "{'Nehalem'}"

    def test_no_times(self, requirements):
        """Equal bytes whenever it is recorded."""
        one, two = (json.dumps(environment(requirements), sort_keys=True) for _ in range(2))
        assert one == two
        assert not re.search(r'"[^"]*(time|date|duration|seconds)[^"]*":', one.split('"packages"')[0])

    def test_outside_a_checkout_the_commit_is_unknown(self, requirements, monkeypatch):
        monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(requirements.parent.parent))
        found = environment(requirements)
        assert found["commit"].startswith("unknown") and found["local_changes"] is None
        json.dumps(found, allow_nan=False)

    def test_commit_and_local_changes(self, requirements):
        folder = requirements.parent

        def git(*arguments: str) -> str:
            identity = ["-c", "user.name=t", "-c", "user.email=t@t", "-c", "commit.gpgsign=false"]
            command = ["git", "-C", str(folder), *identity, *arguments]
            return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()

        git("init", "-q")
        git("add", ".")
        git("commit", "-q", "-m", "one")
        clean = environment(requirements)
        assert (clean["commit"], clean["local_changes"]) == (git("rev-parse", "HEAD"), False)
        requirements.write_text("numpy==0.1\n")
        assert environment(requirements)["local_changes"] is True
