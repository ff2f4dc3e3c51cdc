"""The commands as a user meets them: help that teaches, JSON, exit codes, pipes, Ctrl-C, colours, progress."""

import argparse
import io
import json
import os
import pty
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import thesis_lib
from thesis_lib.__main__ import COMMANDS, main
from thesis_lib.foundation.command_line import Parser, TerminalStream, command
from thesis_lib.foundation.progress import Progress

ROOT = Path(__file__).resolve().parent.parent
NAMES = [name for group in COMMANDS.values() for name in group]
WORDS = [
    *([name] for name in NAMES),
    *(["datasets", name] for name in ("fetch", "check", "init", "example")),
    *(["claims", name] for name in ("check", "update", "page")),
]
HEAVY = ("torch", "sklearn", "matplotlib", "pandas", "numpy", "scipy", "pydrake", "pydantic", "yaml")
PROGRAM = [sys.executable, "-m", "thesis_lib"]


def help_of(words: list[str], capsys) -> str:
    try:
        assert main([*words, "--help"]) == 0
    except SystemExit as stopped:
        assert stopped.code == 0
    return capsys.readouterr().out


# --- help ---


def test_help_names_every_command_and_what_it_needs_to_teach(capsys):
    text = help_of([], capsys)
    assert all(f"\n  {name} " in text for name in NAMES)
    for part in ("examples:", "results/report.html", "Exit codes: 0", "1 a check failed", "130"):
        assert part in text
    assert all(len(line) <= 120 for line in text.splitlines())


def test_the_version_is_that_of_the_package(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"thesis_lib {thesis_lib.__version__}\n"


@pytest.mark.parametrize("words", WORDS, ids=" ".join)
def test_help_of_a_command_has_its_usage_and_an_example(words, capsys):
    text = help_of(words, capsys)
    assert f"usage: thesis-lib {' '.join(words)}" in text
    assert re.search(rf"example.*thesis-lib {' '.join(words)}", text, re.S | re.I)


def examples(text: str) -> list[list[str]]:
    """Commands in a help text, without what they are piped into and what is said beside them."""
    lines = re.findall(r"^ {2,8}thesis-lib (.*)$", re.sub(r"\\\n +", "", text), re.M)
    return [shlex.split(re.split(r" \| | {3,}", line)[0]) for line in lines]


@pytest.mark.parametrize("words", [[], *WORDS], ids=lambda words: " ".join(words) or "all")
def test_examples_in_the_help_are_accepted(words, capsys, monkeypatch):
    class Accepted(Exception):
        pass

    def parse_args(self, argv):
        argparse.ArgumentParser.parse_args(self, argv)
        raise Accepted

    lines = examples(help_of(words, capsys))
    assert lines
    monkeypatch.setattr(Parser, "parse_args", parse_args)
    for line in lines:
        with pytest.raises(Accepted):
            main(line)


def test_help_waits_for_no_heavy_package():
    code = (
        "import sys\nfrom thesis_lib.__main__ import main\n"
        f"for words in {[words for words in WORDS if words != ['datasets', 'example']]} + [[]]:\n"
        "    try: main([*words, '--help'])\n    except SystemExit: pass\n"
        f"print([name for name in {HEAVY} if name in sys.modules], file=sys.stderr)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stderr == "[]\n" and "usage: thesis-lib claims" in done.stdout


# --- mistakes ---


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["datasets", "chek"], "did you mean 'check'?"),
        (["tables", "chapter6"], "did you mean 'chapter"),
        (["predict"], "MODEL.json"),
        (["claims", "check"], "--scale"),
    ],
)
def test_wrong_use_says_what_is_wrong_how_it_goes_and_where_that_is_explained(words, says, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(words)
    out, err = capsys.readouterr()
    assert stopped.value.code == 2 and out == ""
    assert err.startswith("error: ") and says in err
    assert f"usage: thesis-lib {words[0]}" in err and "--help explains it" in err


def test_a_missing_file_is_named_without_a_traceback(tmp_path, capsys):
    @command
    def opens(argv=None):
        return len((tmp_path / "gone").read_text())

    assert opens() == 2
    assert capsys.readouterr().err == f"error: {tmp_path / 'gone'}: No such file or directory\n"


# --- JSON ---


def told(words: list[str], capsys, code: int = 0):
    """What a command prints as JSON, with nothing beside it."""
    assert main(words) == code
    out, err = capsys.readouterr()
    assert err == ""
    return json.loads(out, parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))


def test_the_help_of_rollout_explains_each_row_that_it_prints():
    from thesis_lib.commands.rollout import ROLLOUT
    from thesis_lib.critique.simulation.rollout import GROUPS

    words = set(re.findall(r"\w+", ROLLOUT))
    assert words >= {*GROUPS, *(key for keys in GROUPS.values() for key in keys)}


def test_effects_and_figures_are_json(capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    listed = {effect["name"]: effect for effect in told(["effects", "--json"], capsys)}
    assert {"name", "equation", "equation_in_space", "parameters"} <= listed["lens"].keys()
    assert [p["name"] for p in listed["com_offset"]["parameters_in_space"]] == ["c_x", "c_y", "c_z"]
    figures = told(["figures", "--json"], capsys)
    assert len({figure["figure"] for figure in figures}) == len(figures) > 40
    one = told(["figures", "3-8", "--json", "--results", "nowhere"], capsys)
    assert [file["made"] for file in one["files"]] == [False] * 3
    assert set(one["caption"]) == {file["dataset"] for file in one["files"]}


CLAIM = """
schema: 1
claims:
  - id: table_3_1.mu
    chapter: 3
    location: Table 3.1
    statement: The coefficient of friction of AP Poisson.
    published: 0.062
    source: {file: table.csv, where: {law: poisson}, column: mu}
    check: {kind: abs, tolerance: 0.01, reason: rounding}
"""


def test_claims_check_is_json(tmp_path, capsys):
    (tmp_path / "claims.yaml").write_text(CLAIM)
    (tmp_path / "table.csv").write_text("law,mu\npoisson,0.5\n")
    (tmp_path / "present.json").write_text("{}")
    given = {"ledger": "claims.yaml", "present": "present.json", "results": ""}
    given |= {"expected": "expected.yaml", "stored": "stored"}
    options = [word for name, file in given.items() for word in (f"--{name}", str(tmp_path / file))]
    content = told(["claims", "check", "--scale", "quick", *options, "--json"], capsys, code=1)
    assert content["counts"] == {"reproduced": 0, "deviates": 1, "data not present": 0, "not decided": 0, "error": 0}
    (claim,) = content["claims"]
    assert (claim["id"], claim["status"], claim["ours"]) == ("table_3_1.mu", "deviates", "0.5")
    assert content["changes"][0]["expected"] == "" and content["changes"][0]["found"] == "deviates"
    assert {row["status"] for row in content["figures"]} == {"error"}


# --- terminal, pipe, Ctrl-C ---


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def coloured(monkeypatch):
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")


def test_colours_are_on_a_terminal_only_and_not_against_the_users_wish(coloured, monkeypatch):
    for stream, environment, expected in (
        (Terminal(), {}, "\x1b[1;31merror:\x1b[0m no error: here\n"),
        (Terminal(), {"NO_COLOR": "1"}, "error: no error: here\n"),
        (Terminal(), {"TERM": "dumb"}, "error: no error: here\n"),
        (io.StringIO(), {}, "error: no error: here\n"),
    ):
        with monkeypatch.context() as patch:
            for name, value in environment.items():
                patch.setenv(name, value)
            print("error:", "no error: here", file=TerminalStream(stream))
        assert stream.getvalue() == expected


def test_codes_of_strangers_do_not_reach_the_terminal(coloured):
    stream = Terminal()
    print("a\x1b[31m: adequate", file=TerminalStream(stream))
    assert stream.getvalue() == "a\\x1b[31m: \x1b[1madequate\x1b[0m\n"


@pytest.fixture
def clock():
    class Clock:
        now = 0.0

        def __call__(self) -> float:
            return self.now

    return Clock()


def test_progress_on_a_terminal_is_one_line_with_the_time_left(clock, monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    with Progress("drops", stages={"fitting": 0.25}, clock=clock) as say:
        say("loading")
        clock.now = 10.0
        say("fitting 6 laws")
        assert say.line() == "drops: fitting 6 laws, 10 s; about 30 s left"
        clock.now = 20.0
        say("30 of 40 drops")
        assert say.line() == "drops: 30 of 40 drops, 20 s; about 7 s left"
        clock.now = 60.0  # longer than forecast: no forecast
        assert say.line() == "drops: 30 of 40 drops, 60 s"
    shown = sys.stderr.getvalue()
    assert "\n" not in shown and "\rdrops: loading, 0 s\x1b[K" in shown and shown.endswith("\r\x1b[K")


def test_progress_in_a_log_is_a_line_now_and_then(monkeypatch, capsys):
    monkeypatch.setattr("thesis_lib.foundation.progress.EVERY_LOG", 1.0)
    with Progress("drops") as say:
        say("fitting")
        assert capsys.readouterr().err == ""
        while not (said := capsys.readouterr().err):
            time.sleep(0.01)
    assert all(re.fullmatch(r"drops: fitting, \d+ s", line) for line in said.splitlines())
    with Progress("drops", quiet=True) as say:
        say("fitting")
        time.sleep(0.1)
    assert capsys.readouterr().err == ""


def test_a_closed_pipe_is_silent():
    process = subprocess.Popen(
        [*PROGRAM, "effects"], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    process.stdout.close()  # before anything is written
    assert process.stderr.read() == ""
    assert process.wait() == 0


LONG = """
import sys, time
from thesis_lib.foundation.command_line import command
from thesis_lib.foundation.progress import Progress

@command
def main(argv=None):
    with Progress("drops") as say:
        say("fitting")
        time.sleep(60.0)

sys.exit(main())
"""


def test_ctrl_c_on_a_terminal_is_one_line_and_130():
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-c", LONG],
        cwd=ROOT,
        stdout=subprocess.DEVNULL,
        stderr=theirs,
        # a job in the background of a script ignores Ctrl-C, and hands that on
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    os.close(theirs)
    said = b""
    while b"fitting" not in said:
        said += os.read(ours, 1000)
    process.send_signal(signal.SIGINT)
    while b"\n" not in said:
        said += os.read(ours, 1000)
    os.close(ours)
    assert process.wait(60) == 130
    assert said.endswith(b"\r\x1b[Kinterrupted\r\n") and b"Traceback" not in said
