"""The dependency audit never takes silence for safety."""

import json

import audit
import pytest

PRESENT = {"numpy": "2.4.6", "torch": "2.13.0"}


def report(**packages: dict) -> audit.Outcome:
    return audit.read_report(json.dumps({"dependencies": [{"name": k, **v} for k, v in packages.items()], "fixes": []}))


FINE = {"version": "2.4.6", "vulns": []}
BAD = {"version": "2.13.0", "vulns": [{"id": "PYSEC-1", "fix_versions": [], "aliases": [], "description": ""}]}
SKIPPED = {"skip_reason": "Dependency not found on PyPI and could not be audited: torch (2.13.0)"}


@pytest.mark.parametrize(
    ("found", "strict", "status", "says"),
    [
        (report(numpy=FINE, torch=FINE | {"version": "2.13.0"}), True, 0, "audited: 2 packages"),
        (report(numpy=FINE, torch=BAD), False, 1, "VULNERABLE torch 2.13.0: PYSEC-1"),
        (report(numpy=FINE, torch=SKIPPED), False, 0, "NOT AUDITED: 1 of 2"),
        (report(numpy=FINE, torch=SKIPPED), True, 1, "NOT AUDITED: 1 of 2"),
        (audit.Outcome(), False, 0, "NOT AUDITED: 2 of 2"),
        (report(numpy=SKIPPED, torch=BAD), False, 1, "VULNERABLE"),
    ],
)
def test_verdict(found, strict, status, says):
    exit_status, lines = audit.verdict(found, PRESENT, {}, strict)
    assert exit_status == status and says in "\n".join(lines)


def test_what_changed_since_the_last_audit_is_named():
    record = {"date": "2026-01-01", "packages": {"numpy": "2.4.6", "torch": "2.12.0"}}
    _, lines = audit.verdict(audit.Outcome(), PRESENT, record, False)
    assert lines[1] == "last audit 2026-01-01: 1 of them at these versions; not: torch"
    _, lines = audit.verdict(audit.Outcome(), PRESENT, {}, False)
    assert "no audit is on record" in lines[1]


@pytest.mark.parametrize(
    ("line", "says"),
    [("numpy>=2", "not an exact pin"), ("numpy==2.4.5", "2.4.6 is installed"), ("nothing_at_all==1", "nothing is")],
)
def test_pins_that_do_not_hold_are_named(line, says):
    good = "# text\nNumPy==2.4.6\ntorch==2.13.0  # why\n\n"
    assert audit.wrong_pins(good, PRESENT) == []
    (wrong,) = audit.wrong_pins(good + line + "\n", PRESENT)
    assert says in wrong


def test_this_environment_is_what_environment_txt_says():
    text = (audit.ROOT / "environment.txt").read_text(encoding="utf-8")
    assert audit.wrong_pins(text, audit.installed()) == []
