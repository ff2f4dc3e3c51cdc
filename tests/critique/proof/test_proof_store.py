"""The proof's tables: what is written is read back, runs at once lose nothing, and a check says what moved."""

import multiprocessing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from stored_proof import OUTSIDE, error, named, parameter, put, refuse, row_of

from thesis_lib.foundation.errors import UserError
from thesis_lib.studies.proof import __main__ as command
from thesis_lib.studies.proof import check as proof_check
from thesis_lib.studies.proof import compute as proof_compute
from thesis_lib.studies.proof import sizes as proof_sizes
from thesis_lib.studies.proof import store as proof_store
from thesis_lib.studies.proof.cases import RIGID, SEEDS, SOURCES, Case
from thesis_lib.studies.proof.check import (
    AGREES,
    DIFFERS,
    MOVES,
    WORSE,
    check,
    check_sample,
    compare,
    rerun,
    rows_to_check,
)
from thesis_lib.studies.proof.compute import compute, is_of_today, numbers_of_row, read_rows, sizes_of, table_of
from thesis_lib.studies.proof.store import NOTHING, STORE, code_of

WEAR = Case("law", "wear", SEEDS)
TODAY = code_of(compute)


class TestStore:
    def test_what_is_stored_in_the_checkout_is_written_as_it_stands(self, tmp_path):
        stored = [source for source in SOURCES if (STORE / f"{source}.csv").exists()]
        assert set(RIGID) <= set(stored)
        for source in stored:
            table_of(source, tmp_path).put(*read_rows(source).values())
            assert (tmp_path / f"{source}.csv").read_bytes() == (STORE / f"{source}.csv").read_bytes()

    def test_a_row_reads_back_the_same_to_the_last_bit(self, tmp_path):
        rng = np.random.default_rng(0)
        errors = dict(zip(error(), rng.lognormal(0.0, 9.0, 7).tolist()))
        for seed in range(3):
            case = replace(WEAR, seed=SEEDS + seed, noise=0.1 + 0.2)
            row = put(tmp_path, case, [["wear", "magnus"], ["tilt"]], **errors, parameters=parameter(rng.normal()))
            assert {name: numbers_of_row(row)[name] for name in errors} == errors

    def test_rows_are_sorted_whatever_the_order_in_which_they_came(self, tmp_path):
        cases = [WEAR, replace(WEAR, seed=999), replace(WEAR, drops=50), Case("law", "adhesion", 5)]
        for folder, order in (("one", cases), ("two", cases[::-1])):
            for case in order:
                put(tmp_path / folder, case)
        one, two = ((tmp_path / folder / "law.csv").read_bytes() for folder in ("one", "two"))
        assert one == two and b"\nadhesion,3,150,1,5," in one

    def test_two_runs_at_once_lose_no_row(self, tmp_path):
        def store_many(first: int) -> None:
            for seed in range(first, first + 40):
                put(tmp_path, replace(WEAR, seed=seed))

        fork = multiprocessing.get_context("fork")
        runs = [fork.Process(target=store_many, args=(first,)) for first in (1000, 2000)]
        for run in runs:
            run.start()
        for run in runs:
            run.join()
        assert len(read_rows("law", tmp_path)) == 80
        assert [path.name for path in tmp_path.iterdir()] == ["law.csv"]


class TestCode:
    def test_a_row_is_of_today_s_code_and_sizes_or_older(self, monkeypatch):
        case = Case("mujoco", "tilt", 5)
        row = row_of(case, code=TODAY, sizes=sizes_of(case))
        assert is_of_today(case, row) and not is_of_today(case, {**row, "code": "0" * 16})
        other = {"mujoco": {"ellipse": {"tilt": 2.0 * case.sizes["tilt"]}}}
        monkeypatch.setattr(proof_sizes, "_stored_sizes", lambda: other)
        assert not is_of_today(case, row)

    def test_a_refusal_is_a_row_with_its_reason(self, monkeypatch):
        def refuse_all(dataset, **kwargs):
            raise UserError("too few impacts\nmeasure more")

        monkeypatch.setattr(proof_store, "criticise_drops", refuse_all)
        row = compute(Case("law", NOTHING, 5, drops=12))
        assert (row["verdict"], row["why"], row["n_impacts"]) == ("refused", "too few impacts", 0)


class TestCheck:
    @pytest.fixture
    def store(self, tmp_path, monkeypatch) -> Path:
        """Rows of two sources, some of today's code; computed again they are what they were."""
        for seed in range(4):
            put(tmp_path, replace(WEAR, seed=SEEDS + seed), code=TODAY if seed else "")
        refuse(tmp_path, Case("mechanism", NOTHING, SEEDS))
        self.stored = {case: row for source in SOURCES for case, row in read_rows(source, tmp_path).items()}
        self.changes: dict = {}
        monkeypatch.setattr(proof_check, "compute", lambda case: {**self.stored[case], **self.changes})
        monkeypatch.setattr(proof_check, "code_of", lambda function: TODAY)
        monkeypatch.setattr(proof_check, "stamped", lambda row, function: {**row, "code": TODAY})
        return tmp_path

    def test_rows_of_today_s_code_need_no_check(self, store):
        assert rows_to_check(None, store=store) == [WEAR, Case("mechanism", NOTHING, SEEDS)]
        assert rows_to_check(None, ["mechanism"], store) == [Case("mechanism", NOTHING, SEEDS)]
        assert len(rows_to_check(1, store=store)) == 1 and rows_to_check(0, store=store) == []

    def test_a_sample_is_the_same_each_time_and_another_for_other_code(self, monkeypatch):
        first = rows_to_check(5)
        assert len(first) == 5 and rows_to_check(5) == first
        monkeypatch.setattr(proof_check, "code_of", lambda function: "0" * 16)
        assert rows_to_check(5) != first

    def test_says_how_many_rows_are_older(self, store):
        text = proof_check.ages(store)
        assert TODAY in text
        assert "3 today's,     1 older (1 not known)" in text and "drake         0 today's,     0 older\n" in text

    def test_a_stamp_is_today_s_hash_on_rows_that_agree(self, store):
        cases = rows_to_check(None, store=store)
        assert check(cases, store, tell=list) and rows_to_check(None, store=store) == cases
        assert check(cases, store, stamp=True, tell=list) and rows_to_check(None, store=store) == []

    @pytest.mark.parametrize("change", [{"verdict": "refused"}, {"named": "magnus"}, {"named": ""}])
    def test_another_answer_fails_and_is_never_stored(self, store, change):
        self.changes = change
        said = []
        assert not check([WEAR], store, stamp=True, tell=said.append)
        assert WORSE in said[0] and "wear" in said[0]
        assert read_rows("law", store)[WEAR] == self.stored[WEAR]

    def test_numbers_that_moved_are_told_and_stored(self, store):
        self.changes = table_of("law").cells(error(after=1.01))
        self.changes = {name: self.changes[name] for name in error()}
        said = []
        assert check([WEAR], store, stamp=True, tell=said.append) and "augmented 0.01 → 0.0101" in said[0]
        assert numbers_of_row(read_rows("law", store)[WEAR])["augmented"] == error(after=1.01)["augmented"]

    @pytest.mark.parametrize(("wrong", "computed", "passes"), [(0, 2, True), (1, 6, True), (2, 6, False)])
    def test_a_sample_fails_on_the_second_right_answer_that_became_wrong(
        self, store, monkeypatch, wrong, computed, passes
    ):
        for seed in range(4, 9):
            put(store, replace(WEAR, seed=SEEDS + seed))
        stored = read_rows("law", store)
        order = rows_to_check(6, ["law"], store)
        assert len(order) == 6 and rows_to_check(2, ["law"], store) == order[:2]
        turned = order[:wrong]
        monkeypatch.setattr(
            proof_check, "compute", lambda case: {**stored[case], "named": "" if case in turned else "wear"}
        )
        said = []
        assert check_sample(2, ["law"], store, tell=said.append) is passes and len(said) == computed

    @pytest.mark.parametrize(
        ("change", "status"),
        [
            ({}, AGREES),
            (error(after=1.0 + 1e-5), AGREES),
            ({"floor": 0.0102, "remaining_p": 0.9}, AGREES),  # both are drawn
            ({"floor": 0.011}, MOVES),
            ({"flight_base": np.nan}, MOVES),
            ({"n_impacts": 299}, MOVES),
            ({"parameters": ""}, MOVES),
            ({"parameters": parameter(1.0, 1.2)}, MOVES),
            ({"verdict": "unexplained"}, WORSE),  # though the effect is named first
            ({"named": "wear/magnus"}, DIFFERS),
            ({"named": "magnus"}, WORSE),
            ({"verdict": "refused"}, WORSE),
        ],
    )
    def test_what_counts_as_another_row(self, change, status):
        row = row_of(WEAR, parameters=parameter(1.0))
        assert compare(WEAR, row, table_of("law").cells(row | change))[0] == status

    def test_the_order_within_a_group_is_no_part_of_the_answer(self):
        row = row_of(WEAR, [["wear", "magnus"]])
        assert compare(WEAR, row, {**row, "named": named([["magnus", "wear"]])})[0] == AGREES
        assert compare(WEAR, row, {**row, "named": named([["magnus"], ["wear"]])})[0] == WORSE

    def test_another_stand_in_for_what_is_outside_is_told_and_does_not_fail(self, store):
        plate = Case("mechanism", OUTSIDE, SEEDS)
        self.stored[plate] = put(store, plate, [["moving_surface", "sensor_drift"]])
        said = []
        self.changes = {"named": "tilt"}
        assert check([plate], store, tell=said.append) and "differs" in said[0]
        assert not check([plate], store, tell=said.append, failing=(DIFFERS, WORSE))

    def test_a_rerun_agrees_or_names_what_differs(self, store):
        table = rerun(["law/wear", f"mechanism/{NOTHING}"], store)
        assert table["agrees"].tolist() == [1, 1] and table["verdict"].tolist() == ["effects", "refused"]
        self.changes = {"verdict": "unexplained"}
        with pytest.raises(UserError, match=r"law/wear 1000 .*now unexplained"):
            rerun(["law/wear"], store)
        with pytest.raises(UserError, match="--source law --truths magnus"):
            rerun(["law/magnus"], store)


class TestCommand:
    @pytest.fixture
    def store(self, tmp_path, monkeypatch) -> Path:
        monkeypatch.setattr(command, "compute", row_of)
        monkeypatch.setattr(proof_compute, "compute", row_of)
        monkeypatch.setattr(command, "run", lambda cases, jobs, tell: proof_compute.run(cases, jobs, tell, tmp_path))
        return tmp_path

    def test_a_run_goes_on_where_it_stopped(self, store, capsys):
        put(store, WEAR, [])
        assert command.main(["run", "--source", "law", "--truths", "wear", NOTHING, "--seeds", "2"]) == 0
        assert capsys.readouterr().out.count("\n") == 4
        rows = read_rows("law", store)
        assert len(rows) == 4 and rows[WEAR]["named"] == "" and rows[replace(WEAR, seed=SEEDS + 1)]["named"] == "wear"

    def test_tuning_seeds_are_not_stored(self, store, capsys):
        assert command.main(["run", "--truths", "pairs", "--source", "law", "--development"]) == 0
        assert capsys.readouterr().out.count("law/") == 10 and not list(store.iterdir())

    def test_an_unknown_truth_is_named(self, store, capsys):
        assert command.main(["run", "--truths", "phlogiston"]) == 2
        assert "is called phlogiston" in capsys.readouterr().err

    def test_without_a_checkout_one_sentence_says_so(self, tmp_path, monkeypatch, capsys):
        monkeypatch.setattr(proof_sizes, "SIZES", tmp_path / "proof_sizes.json")
        assert command.main(["table"]) == 2
        told = capsys.readouterr()
        assert told.out == "" and told.err.count("\n") == 1 and "needs a checkout of the project" in told.err
