"""Known vulnerabilities of what is installed, and whether anybody looked: `python tests/safety/audit.py`.

| step     | what                                                                         | needs                 |
|----------|------------------------------------------------------------------------------|-----------------------|
| pins     | every pin of environment.txt is installed at its version                     | nothing               |
| check    | `pip check`: no installed package lacks what it asks for                     | nothing               |
| advisory | pip-audit asks PyPI for the advisories of every installed version            | pypi.org and its JSON |

Mirrors of PyPI seldom carry the advisories.  pip-audit then skips every package and still says that nothing was found;
here that counts as *not audited*, is said, and fails with --strict.  A finding always fails.  The last audit that saw
advisories, with its date and the versions it saw, is stored in audited.json by --record, and what has changed since is
listed where no advisory can be had.
"""

import argparse
import json
import re
import subprocess
import sys
import tempfile
import venv
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RECORD = Path(__file__).with_name("audited.json")
# in an environment of its own: it brings thirty packages that nothing here needs
PIP_AUDIT = "pip-audit==2.10.1"


@dataclass
class Outcome:
    """What pip-audit said: (name, version) of what was looked up, what was skipped, and ids of advisories by name."""

    seen: dict[str, str] = field(default_factory=dict)
    skipped: dict[str, str] = field(default_factory=dict)
    findings: dict[str, list[str]] = field(default_factory=dict)


def installed() -> dict[str, str]:
    """Installed packages by normalised name, without local version labels such as +cpu."""
    found = {_normal(one.metadata["Name"]): one.version.split("+")[0] for one in metadata.distributions()}
    return dict(sorted(found.items()))


def wrong_pins(requirements: str, present: dict[str, str]) -> list[str]:
    """Lines of environment.txt that are not exact pins, or not what is installed."""
    wrong = []
    for line in requirements.splitlines():
        line = line.partition("#")[0].strip()
        if not line:
            continue
        name, exact, version = line.partition("==")
        here = present.get(_normal(name), "nothing")
        if not exact:
            wrong.append(f"{line}: not an exact pin")
        elif here != version.strip():
            wrong.append(f"{line}: {here} is installed")
    return wrong


def read_report(text: str) -> Outcome:
    """The JSON of pip-audit."""
    out = Outcome()
    for one in json.loads(text)["dependencies"]:
        if "skip_reason" in one:
            out.skipped[_normal(one["name"])] = one["skip_reason"]
            continue
        out.seen[_normal(one["name"])] = one["version"]
        if one["vulns"]:
            out.findings[_normal(one["name"])] = [vuln["id"] for vuln in one["vulns"]]
    return out


def ask(present: dict[str, str]) -> Outcome:
    """Run pip-audit over these versions.

    Raises:
        OSError: it could not be installed, or gave no report.
    """
    with tempfile.TemporaryDirectory() as folder:
        venv.create(folder, with_pip=True)
        python = str(Path(folder) / "bin" / "python")
        install = [python, "-m", "pip", "install", "--quiet", PIP_AUDIT]
        done = subprocess.run(install, capture_output=True, text=True)
        if done.returncode:
            raise OSError(f"{PIP_AUDIT} could not be installed: {done.stderr.strip()[-300:]}")
        listed = Path(folder) / "installed.txt"
        listed.write_text("".join(f"{name}=={version}\n" for name, version in present.items()))
        command = [python, "-m", "pip_audit", "--requirement", str(listed), "--no-deps", "--disable-pip"]
        done = subprocess.run(
            [*command, "--format", "json", "--progress-spinner", "off"], capture_output=True, text=True
        )
        if not done.stdout.startswith("{"):
            raise OSError(f"pip-audit gave no report: {done.stderr.strip()[-300:]}")
        return read_report(done.stdout)


def verdict(out: Outcome, present: dict[str, str], record: dict, strict: bool) -> tuple[int, list[str]]:
    """Exit status and what to say."""
    lines = [f"VULNERABLE {name} {out.seen[name]}: {', '.join(ids)}" for name, ids in out.findings.items()]
    if out.findings:
        return 1, lines
    missing = sorted(set(present) - set(out.seen))
    if not missing:
        return 0, [f"audited: {len(out.seen)} packages, no advisory"]
    lines.append(f"NOT AUDITED: {len(missing)} of {len(present)} packages, no advisories can be had for them here")
    if record:
        changed = [name for name in missing if record["packages"].get(name) != present[name]]
        lines.append(
            f"last audit {record['date']}: {len(missing) - len(changed)} of them at these versions"
            + (f"; not: {', '.join(changed)}" if changed else "")
        )
    else:
        lines.append("no audit is on record; run this where pypi.org can be reached, with --record DATE")
    return (1 if strict else 0), lines


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--strict", action="store_true", help="fail if a package could not be looked up")
    parser.add_argument("--record", metavar="DATE", help="store an audit of all packages under this date")
    options = parser.parse_args(arguments)
    present = installed()
    wrong = wrong_pins((ROOT / "environment.txt").read_text(encoding="utf-8"), present)
    print("\n".join(wrong) if wrong else "pins: environment.txt is what is installed")
    check = subprocess.run([sys.executable, "-m", "pip", "check"], capture_output=True, text=True)
    print(check.stdout.strip())
    try:
        out = ask(present)
    except OSError as error:
        print(error)
        out = Outcome()
    record = json.loads(RECORD.read_text(encoding="utf-8")) if RECORD.is_file() else {}
    status, lines = verdict(out, present, record, options.strict)
    print("\n".join(lines))
    if options.record and set(present) <= set(out.seen) and not out.findings:
        content = {"date": options.record, "tool": PIP_AUDIT, "service": "pypi.org", "packages": present}
        RECORD.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    return 1 if wrong or check.returncode else status


def _normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name.strip()).lower()


if __name__ == "__main__":
    sys.exit(main())
