"""`effects --check`, `effects --new`, and --effects of the other commands, as a user meets them."""

import json
import re
import subprocess
import sys
from pathlib import Path

import own_files
import pytest

from thesis_lib.__main__ import main
from thesis_lib.extensions.effect_contract import EFFECT_CHECKS
from thesis_lib.extensions.law_contract import LAW_CHECKS, SPACE_CHECKS
from thesis_lib.extensions.template import template
from thesis_lib.foundation.errors import UserError

ROOT = Path(__file__).resolve().parents[2]
NAME = "slip_dependent_restitution"


def test_check_has_a_line_a_check_and_exit_code_0(own_effect, capsys):
    assert main(["effects", "--check", str(own_effect)]) == 0
    out, err = capsys.readouterr()
    first, *lines, last = out.splitlines()
    assert (
        first == f"{own_effect}: the effect {NAME}"
        and last == f"{len(EFFECT_CHECKS)} of {len(EFFECT_CHECKS)} checks pass"
    )
    assert lines == [f"  pass  {check.name}" for check in EFFECT_CHECKS]
    assert err.startswith(f"note: {own_effect} is a program")


def test_check_says_why_a_check_fails_with_exit_code_1(tmp_path, capsys):
    path = tmp_path / "wrong.py"
    path.write_text(own_files.NO_IDENTITY + own_files.LAW, encoding="utf-8")
    assert main(["effects", "--check", str(path)]) == 1
    out = capsys.readouterr().out
    assert "  FAIL  changes nothing at its null: coefficients with all parameters at null must return" in out
    n = len(EFFECT_CHECKS) + len(LAW_CHECKS) + len(SPACE_CHECKS)
    assert f"{path}: the law my_law" in out and f"1 of {n} checks fail" in out
    assert main(["effects", "--check", str(path), "--json"]) == 1
    rows = json.loads(capsys.readouterr().out)
    assert [row["check"] for row in rows if row["verdict"] == "FAIL"] == ["changes nothing at its null"]


@pytest.mark.parametrize("text", [own_files.NO_IDENTITY.replace(f'"{NAME}"', '"wear"'), own_files.LAW_THAT_FAILS])
def test_check_refuses_a_name_of_the_library_whatever_else_is_wrong(text, tmp_path, capsys):
    path = tmp_path / "taken.py"
    path.write_text(text.replace('"my_law"', '"mirtich"'), encoding="utf-8")
    assert main(["effects", "--check", str(path)]) == 2
    out, err = capsys.readouterr()
    assert out == "" and re.search("the name '(mirtich|wear)' is used by .* of the library; give your", err)


def test_check_says_one_fault_once_with_the_number_of_checks_that_meet_it(tmp_path, capsys):
    path = tmp_path / "fails.py"
    path.write_text(own_files.LAW_THAT_FAILS, encoding="utf-8")
    n = len(LAW_CHECKS) + len(SPACE_CHECKS)
    assert main(["effects", "--check", str(path)]) == 1
    _, passed, failed, last = capsys.readouterr().out.splitlines()
    assert passed == f"  pass  {LAW_CHECKS[0].name}" and last == f"{n - 1} of {n} checks fail"
    fault = "ZeroDivisionError: division by zero (fails.py, line 8)"
    assert failed == f"  FAIL  {LAW_CHECKS[1].name}: {fault}; {n - 2} more checks fail in the same way"
    assert main(["effects", "--check", str(path), "--json"]) == 1
    assert len(json.loads(capsys.readouterr().out)) == n


def test_check_of_a_file_that_cannot_be_loaded_has_exit_code_2(tmp_path, capsys):
    path = tmp_path / "broken.py"
    path.write_text("import nothing_like_it\n")
    assert main(["effects", "--check", str(path)]) == 2
    assert "ModuleNotFoundError: No module named 'nothing_like_it' (broken.py, line 1)" in capsys.readouterr().err


def test_new_writes_a_file_that_passes_and_does_nothing_yet(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["effects", "--new", "sticky_corners"]) == 0
    path = tmp_path / "sticky_corners.py"
    text = path.read_text(encoding="utf-8")
    assert main(["effects", "--check", "sticky_corners.py"]) == 0
    out = capsys.readouterr().out
    verdicts = [line.split()[0] for line in out.splitlines() if line.startswith("  ")]
    assert verdicts.count("pass") == len(EFFECT_CHECKS) - 1 and verdicts.count("to") == 1
    assert "it changes nothing yet" in out
    assert main(["effects", "--new", "sticky_corners"]) == 2
    assert "exists already and stays as it is" in capsys.readouterr().err and path.read_text(encoding="utf-8") == text


def test_the_template_becomes_an_effect_by_one_line(tmp_path, capsys):
    path = tmp_path / "sticky.py"
    path.write_text(template("sticky").replace("0.0 * contact.v_t", "np.abs(contact.v_t)"), encoding="utf-8")
    assert main(["effects", "--check", str(path)]) == 0
    assert f"{len(EFFECT_CHECKS)} of {len(EFFECT_CHECKS)} checks pass" in capsys.readouterr().out
    path.write_text(path.read_text(encoding="utf-8").replace("def coefficients", "def coeficients"), encoding="utf-8")
    assert main(["effects", "--check", str(path)]) == 1
    assert "no stage coeficients (did you mean 'coefficients'?)" in capsys.readouterr().out


def test_the_template_is_clean_code():
    text = template("sticky_corners")
    assert max(map(len, text.splitlines())) <= 120 and "{" not in text
    done = subprocess.run(
        [sys.executable, "-m", "ruff", "check", "--no-cache", "--stdin-filename", ROOT / "sticky_corners.py", "-"],
        input=text, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("name", ["Sticky", "../sticky", "sticky-corners", "com_offset", "", "x" * 61])
def test_a_name_that_cannot_be_used_is_refused(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError):
        template(name)
    assert main(["effects", f"--new={name}"]) == 2 and not list(tmp_path.iterdir())


def test_no_template_is_written_into_data(tmp_path, monkeypatch, capsys):
    (tmp_path / "dataset.yaml").touch()
    monkeypatch.chdir(tmp_path)
    assert main(["effects", "--new", "sticky"]) == 2 and "holds data" in capsys.readouterr().err


@pytest.mark.parametrize(
    "command", [["critique", "DATA"], ["predict", "m.json", "s.csv"], ["simulate", "m.json", "-o", "x"]]
)
def test_a_name_behind_effects_is_no_file(command, capsys):
    assert main([*command, "--effects", "com_offset"]) == 2
    assert "a name goes behind --effect" in capsys.readouterr().err


def test_a_file_beside_the_data_of_a_critique_is_refused(own_effect, capsys):
    assert main(["critique", str(own_effect.parent), "--effects", str(own_effect)]) == 2
    assert "Code out of a dataset never runs" in capsys.readouterr().err


def test_the_list_names_the_origin(own_effect, capsys):
    from thesis_lib.commands.effects import effects_json, effects_text
    from thesis_lib.extensions.loading import load

    load([own_effect], say=lambda text: None)
    assert "      not part of the library; from my_effects.py" in effects_text()
    (entry,) = [entry for entry in json.loads(effects_json()) if "origin" in entry]
    assert entry["name"] == NAME and entry["origin"]["file"] == "my_effects.py"
