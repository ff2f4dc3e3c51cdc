"""The DAG builds with and without measured data, and a wrong configuration is refused in words."""

import re
import sys
from pathlib import Path

import pytest

MEASURED = ("planar_impact", "planar_dice", "contactnets_cube")


def jobs(output: str) -> dict[str, int]:
    """Rule -> number of jobs, from the table that a dry run prints."""
    table = output.split("Job stats:")[-1]
    counts = {name: int(n) for name, n in re.findall(r"^([a-z]\w*)\s+(\d+)\s*$", table, re.MULTILINE)}
    assert counts.pop("total") == sum(counts.values())
    return counts


def outputs(output: str) -> str:
    return " ".join(re.findall(r"output: (.*)", output))


@pytest.mark.slow
def test_without_measured_data_the_simulated_drops_remain(checkout, snakemake):
    done = snakemake(checkout, "-n", "--config", "seed=7")
    assert done.returncode == 0, done.stdout
    # nothing is found in data/measured, and what lies beside the real checkout is not beside this one
    for name in MEASURED:
        assert f"The measured dataset {name} is not present" in done.stdout
        assert f"fetch {name.replace('_', '-')}" in done.stdout
    counts = jobs(done.stdout)
    for rule in ("all", "simulate_drops", "find_impacts", "ch3_identify", "ch3_evaluate", "claims", "provenance"):
        assert counts[rule] == 1, rule
    assert not {"convert_measured", "ch3_published"} & set(counts)
    assert not any(name in outputs(done.stdout) for name in MEASURED)


@pytest.mark.slow
def test_measured_data_in_our_format_are_used_as_they_are(checkout, snakemake):
    """Converted sets, two in the plane, and the drops: three studies, nothing to convert, the authors' comparison."""
    for name in MEASURED:
        folder = checkout / "elsewhere" / name
        folder.mkdir(parents=True)
        (folder / "dataset.yaml").write_text("schema: 1\n")
    (checkout / "overlay.yaml").write_text("measured: [data/measured, elsewhere]\n")
    done = snakemake(checkout, "-n", "--configfile", "overlay.yaml")
    assert done.returncode == 0, done.stdout
    assert "not present" not in done.stdout
    counts = jobs(done.stdout)
    assert "convert_measured" not in counts
    for rule in ("find_impacts", "ch3_identify", "ch3_evaluate"):
        assert counts[rule] == 3, rule
    assert counts["ch3_published"] == counts["claims"] == 1


@pytest.mark.slow
def test_an_overlay_reaches_the_jobs_and_studied_datasets_are_a_choice(checkout, snakemake):
    (checkout / "overlay.yaml").write_text(
        "drops: {n: 77}\nchapter3: {datasets: [drops]}\ncritique: {datasets: []}\nmeasured: []\n"
    )
    done = snakemake(checkout, "-n", "results/chapter3/drops/table_3_1.csv", "--configfile", "overlay.yaml")
    assert done.returncode == 0, done.stdout
    assert jobs(done.stdout) == {"simulate_drops": 1, "find_impacts": 1, "ch3_identify": 1, "ch3_evaluate": 1}
    assert "Simulating 77 drops" in done.stdout


@pytest.mark.slow
def test_wrong_configuration_is_refused_without_a_traceback(checkout, snakemake):
    overlay = "drops: {n: many}\nchapter3: {bootstraps: 3, topography: {law: mirtch}}\n"
    (checkout / "overlay.yaml").write_text(overlay)
    done = snakemake(checkout, "-n", "--configfile", "overlay.yaml")
    assert done.returncode != 0
    assert "3 mistake" in done.stdout and "Traceback" not in done.stdout
    for key in ("drops.n", "chapter3.bootstraps", "chapter3.topography.law"):
        assert key in done.stdout


@pytest.mark.slow
class TestReruns:
    """One cheap rule is run; then only an edit of code that it uses makes it run again."""

    TARGET = "results/datasets/present.json"

    def edit(self, checkout: Path, module: str, text: str) -> None:
        path = checkout / "thesis_lib" / module
        path.write_text(path.read_text(encoding="utf-8") + text, encoding="utf-8")

    def is_due(self, checkout, snakemake) -> bool:
        done = snakemake(checkout, "-n", self.TARGET)
        assert done.returncode == 0, done.stdout
        return "Nothing to be done" not in done.stdout

    def test_code_counts_and_comments_do_not(self, checkout, snakemake):
        done = snakemake(checkout, "--cores", "1", "--verbose", self.TARGET)
        assert done.returncode == 0, done.stdout
        assert (checkout / self.TARGET).is_file()
        # the scheduler sleeps while jobs run: a limit on submissions (100) would wake it every second for every job
        left = re.findall(r"Resources after job selection: .*'_job_count': (\d+)", done.stdout)
        assert left and set(map(int, left)) == {sys.maxsize}
        self.edit(checkout, "foundation/files.py", "\n\n# a comment\n")
        self.edit(checkout, "contact/mirtich.py", "\nEDITED = True\n")
        assert not self.is_due(checkout, snakemake)
        self.edit(checkout, "foundation/files.py", "\nEDITED = True\n")
        assert self.is_due(checkout, snakemake)


@pytest.mark.slow
def test_a_failing_job_leaves_its_error_in_its_log_and_no_output(checkout, snakemake):
    module = checkout / "thesis_lib" / "foundation" / "files.py"
    broken = '\n\ndef write_json(*_):\n    raise RuntimeError("broken on purpose")\n'
    module.write_text(module.read_text(encoding="utf-8") + broken, encoding="utf-8")
    done = snakemake(checkout, "--cores", "1", "results/datasets/present.json")
    assert done.returncode != 0
    assert "broken on purpose" in (checkout / "results/logs/datasets_present.log").read_text()
    assert not (checkout / "results/datasets/present.json").exists()
