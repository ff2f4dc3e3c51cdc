"""The README says what is: its numbers, commands, paths and code."""

import re
from collections import Counter
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def statuses() -> dict[str, str]:
    text = (ROOT / "config" / "claims_expected.yaml").read_text(encoding="utf-8")
    return yaml.safe_load(text)["expected"]["default"]


def test_claims_summary_is_that_of_the_stored_statuses(statuses):
    counts = Counter(statuses.values())
    claims = yaml.safe_load((ROOT / "config" / "claims.yaml").read_text(encoding="utf-8"))["claims"]
    said = re.search(r"(\d+) claims: (\d+) reproduced, (\d+) deviate, (\d+) without data", README)
    assert said, "the README has lost its summary of the claims"
    assert [int(number) for number in said.groups()] == [
        len(claims),
        counts["reproduced"],
        counts["deviates"],
        len(claims) - len(statuses),  # absent data is neutral and therefore not stored
    ]


def test_what_deviates_is_counted_as_said(statuses):
    deviating = [name for name, status in statuses.items() if status == "deviates"]
    defined = sum(name.endswith("as_defined") for name in deviating)
    beyond = sum("no_back_spin" in name or "up_to_sticking" in name for name in deviating)
    assert re.search(rf"Of the {len(deviating)}, {defined} are the laws .*and {beyond} are", README, re.S)


@pytest.mark.parametrize("target", sorted(set(re.findall(r"(?:`|^    )make ([a-z]+)", README, re.M))))
def test_make_targets_exist(target):
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert re.search(rf"^{target}:", makefile, re.M), f"make {target}"


@pytest.mark.parametrize(
    "path", sorted(set(re.findall(r"`((?:thesis_lib|config|tests|\.ci)/[\w./*-]+)`", README)))
)
def test_paths_exist(path):
    assert list(ROOT.glob(path.rstrip("/"))) or "<" in path, path


def test_the_library_example_runs():
    code = re.search(r"```python\n(.*?)```", README, re.S).group(1)
    space: dict = {}
    exec(code.split("impacts = ")[0], space)
    assert space["out"].v_post.shape == (1, 3) and space["out"].status.tolist() == [0]
    assert callable(space["find_impacts"]) and callable(space["read_dataset"])


@pytest.mark.parametrize("command", ["fetch", "init", "check"])
def test_dataset_commands_exist(command, capsys):
    from thesis_lib.datasets.__main__ import main

    assert f"thesis_lib.datasets {command}" in README
    with pytest.raises(SystemExit) as stopped:
        main([command, "--help"])
    assert stopped.value.code == 0 and command in capsys.readouterr().out
