"""Scripts of rules and benchmarks run outside the tests: what they import must be where they look for it."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[2]
SCRIPTS = sorted([*(ROOT / "workflow/scripts").rglob("*.py"), *(ROOT / "benchmarks").glob("*.py")])


def missing(script: Path) -> list[str]:
    """Names that a file imports from thesis_lib and that no line there makes."""
    found = []
    for node in ast.walk(ast.parse(script.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("thesis_lib"):
            place = ROOT / node.module.replace(".", "/")
            source = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
            text = source.read_text(encoding="utf-8") if source.is_file() else ""
            for name in (alias.name for alias in node.names):
                if name not in text and not (place / f"{name}.py").is_file() and not (place / name).is_dir():
                    found.append(f"{node.module}.{name}")
    return found


def test_scripts_import_what_is_there(tmp_path):
    assert len(SCRIPTS) > 50
    assert {str(path.relative_to(ROOT)): names for path in SCRIPTS if (names := missing(path))} == {}
    (tmp_path / "moved.py").write_text("from thesis_lib.critique.results.saved_model import of_no_such_name\n")
    assert missing(tmp_path / "moved.py") == ["thesis_lib.critique.results.saved_model.of_no_such_name"]
