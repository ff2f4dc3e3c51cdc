"""What jobs used, kept, and turned into what they ask for."""

from pathlib import Path

import pytest

from thesis_lib import pipeline
from thesis_lib.foundation.errors import CorruptFileError, UserError
from thesis_lib.resources import (
    MACHINE,
    MEASURED,
    Use,
    main,
    read_measured,
    read_uses,
    recorded,
    request,
    slower,
    write_measured,
)

HEADER = "s\th:m:s\tmax_rss\tmax_vms\tmax_uss\tmax_pss\tio_in\tio_out\tmean_load\tcpu_time\n"
SMALL = {"quick": {"peak_mb": 150.0, "cpu_s": 2.0}}
LARGE = {"quick": {"peak_mb": 300.0, "cpu_s": 90.0}, "default": {"peak_mb": 700.0, "cpu_s": 60.0}}
PLAN = {"small": SMALL, "large": LARGE}


def benchmark(results: Path, name: str, peak: str, cpu: str, wall: str = "9.5") -> Path:
    path = results / "logs/benchmarks" / f"{name}.tsv"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"{HEADER}{wall}\t0:00:09\t{peak}\t1\t1\t1\t0\t0\t9\t{cpu}\n")
    return path


@pytest.fixture
def results(tmp_path) -> Path:
    folder = tmp_path / "results"
    benchmark(folder, "large/a", "410.5", "7.25")
    benchmark(folder, "large/b/c", "380.0", "30.0")
    benchmark(folder, "small", "NA", "NA", wall="0.4")
    return folder


class TestRequest:
    def test_is_the_worst_of_all_scales_with_margins(self):
        # 1.5 × 700 MB + 400 MB, up to whole hundreds; 10 min + 4 × 90 s
        asked = request(PLAN, "large")
        assert (asked.mem_mb, asked.runtime) == (1500, 16)

    def test_small_jobs_still_get_room_for_python_and_snakemake(self):
        assert request(PLAN, "small").mem_mb == 700

    def test_grows_with_every_attempt(self):
        first, third = request(PLAN, "large"), request(PLAN, "large", attempt=3)
        assert (third.mem_mb, third.runtime) == (3 * first.mem_mb, 3 * first.runtime)

    def test_what_was_not_measured_is_taken_from_the_most_demanding_rule(self):
        timed = {**PLAN, "timed": {"default": {"cpu_s": 2.0}}}
        assert request(timed, "timed").mem_mb == request(PLAN, "large").mem_mb
        assert request(timed, "timed").runtime == request(PLAN, "small").runtime
        assert request(PLAN, "new") == request(PLAN, "large")
        assert request({}, "new").mem_mb == request(PLAN, "small").mem_mb


class TestReading:
    def test_jobs_of_a_rule_are_added_up_and_the_largest_kept(self, results):
        uses = read_uses(results)
        assert uses["large"] == Use(jobs=2, cpu_s=37.25, largest_cpu_s=30.0, peak_mb=410.5)
        # too short to be sampled: its wall time stands in
        assert uses["small"] == Use(jobs=1, cpu_s=0.4, largest_cpu_s=0.4, peak_mb=0.0)

    def test_no_benchmarks_say_what_to_run(self, tmp_path):
        with pytest.raises(UserError, match="make reproduce"):
            read_uses(tmp_path)

    @pytest.mark.parametrize("text", ["", HEADER, HEADER + "x\ty\n", "a\tb\n1\t2\n", HEADER * 3])
    def test_a_broken_benchmark_is_named(self, results, text):
        (results / "logs/benchmarks/small.tsv").write_text(text)
        with pytest.raises(CorruptFileError, match=r"small\.tsv"):
            read_uses(results)

    @pytest.mark.parametrize("text", ["- a\n", "large: 3\n", "large: {quick: {cpu: 2}}\n", "large: [\n", "\0"])
    def test_a_broken_plan_is_named(self, tmp_path, text):
        path = tmp_path / "resources.yaml"
        path.write_text(text)
        with pytest.raises(UserError, match=r"resources\.yaml"):
            read_measured(path)

    def test_a_missing_plan_is_named(self, tmp_path):
        with pytest.raises(UserError, match="does not exist"):
            read_measured(tmp_path / "resources.yaml")


def test_recording_replaces_one_scale_of_the_rules_that_ran(results, tmp_path):
    found = recorded(PLAN, read_uses(results), "quick")
    quick = {"peak_mb": 411.0, "cpu_s": 30.0, "mean_cpu_s": 19.0}  # of 7.25 s and 30 s
    assert found["large"] == {"quick": quick, "default": LARGE["default"]}
    assert found["small"]["quick"] == {"peak_mb": 0.0, "cpu_s": 1.0}
    path = tmp_path / "resources.yaml"
    found[MACHINE] = {"quick": {"pace_s": 0.25, "total_cpu_s": 38.0}}
    write_measured(found, path)
    assert read_measured(path) == found


class TestCommand:
    def test_shows_a_table(self, results, capsys):
        assert main(["--results", str(results), "--measured", str(results / "none.yaml")]) == 0
        lines = capsys.readouterr().out.splitlines()
        assert lines[1].split()[:5] == ["large", "2", "37.2", "30.0", "410"]
        assert lines[-1].split() == ["total", "3", "37.6", "410"]

    def test_records(self, results, tmp_path):
        path = tmp_path / "resources.yaml"
        assert main(["record", "--scale", "full", "--results", str(results), "--measured", str(path)]) == 0
        assert set(read_measured(path)["large"]) == {"full"}
        measured = read_measured(path)
        assert set(measured[MACHINE]) == {"full"} and measured[MACHINE]["full"]["total_cpu_s"] == 38.0
        # measured on this very machine, busy or not
        assert 0.2 < slower(measured)["full"] < 5.0

    def test_the_cpu_time_of_a_run_in_one_piece_takes_the_place_of_the_sum(self, results, tmp_path, capsys):
        path = tmp_path / "resources.yaml"
        record = ["record", "--scale", "full", "--results", str(results), "--measured", str(path), "--cpu-min"]
        assert main([*record, "2"]) == 0 and read_measured(path)[MACHINE]["full"]["total_cpu_s"] == 120.0
        with pytest.raises(SystemExit):
            main([*record, "0"])
        assert "--cpu-min must be a number of minutes above 0, not 0" in capsys.readouterr().err

    def test_a_mistake_is_told_without_a_traceback(self, tmp_path, capsys):
        assert main(["--results", str(tmp_path)]) == 2
        assert "holds no benchmarks" in capsys.readouterr().err


def test_a_run_in_a_terminal_says_how_long_its_scale_takes_here(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("thesis_lib.resources.pace_s", lambda: 0.06)  # three times as slow
    pipeline._say_whole("quick", 2)
    assert capsys.readouterr().out == ""
    MEASURED.parent.mkdir()
    write_measured({**PLAN, MACHINE: {"quick": {"pace_s": 0.02, "total_cpu_s": 600.0}}}, MEASURED)
    pipeline._say_whole("quick", 2)
    assert "about 30 min of CPU on this machine, about 15 min on 2 cores" in capsys.readouterr().out
    # of a scale without a machine the measured times are taken as they are
    assert pipeline._cpu_of_jobs("quick") == {"small": 6.0, "large": 270.0}
    assert pipeline._cpu_of_jobs("default") == {"large": 60.0}


def test_every_rule_of_the_stored_plan_was_measured():
    plan = read_measured(Path(__file__).resolve().parents[1] / MEASURED)
    assert plan.pop(MACHINE)
    for rule, scales in plan.items():
        assert {"peak_mb", "cpu_s"} <= set(scales["quick"]), rule
