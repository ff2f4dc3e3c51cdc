"""The tutorials are true: every command runs, and prints what is said."""

from pathlib import Path

import pytest
from tutorial_runner import ROOT, Step, compare, run, steps_of

from tests.workflow.pipeline_copy import copy_pipeline

TUTORIALS = sorted((ROOT / "docs").glob("tutorial_*.md"))
LONGEST = 120  # lines: what is read in one go


@pytest.mark.slow
@pytest.mark.parametrize("page", TUTORIALS, ids=lambda path: path.stem)
def test_every_command_of_a_tutorial_runs_and_prints_what_is_said(page: Path, tmp_path: Path) -> None:
    project = copy_pipeline(tmp_path / "project", "docs", "tests", "pyproject.toml")
    steps = steps_of(page.read_text(encoding="utf-8"))
    assert steps
    elsewhere = project
    if any(step.repository for step in steps):
        elsewhere = tmp_path / "mine"
        elsewhere.mkdir()
    for step in steps:
        run(step, project if step.repository else elsewhere, project)


@pytest.mark.parametrize("page", TUTORIALS, ids=lambda path: path.stem)
def test_a_tutorial_is_short(page: Path) -> None:
    assert len(page.read_text(encoding="utf-8").splitlines()) < LONGEST


def test_a_tutorial_that_is_not_true_is_noticed(tmp_path: Path) -> None:
    page = "Save this as `a.txt`:\n\n```python\nerror 0.05 m/s\n```\n"
    page += "```bash\ncat a.txt\n```\n```text\nerror 0.052 m/s\n```\n"
    save, show = steps_of(page)
    run(save, tmp_path)
    assert run(show, tmp_path) == "error 0.05 m/s\n"
    with pytest.raises(AssertionError, match="is now"):
        compare("error 0.06 m/s", "error 0.05 m/s")
    with pytest.raises(AssertionError, match="not printed"):
        compare("floor 0.05 m/s", "error 0.05 m/s")
    with pytest.raises(AssertionError, match="ends with 1"):
        run(Step("grep nothing a.txt | cat"), tmp_path)
