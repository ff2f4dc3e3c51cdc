"""An edit in thesis_lib changes the hash of exactly the scripts that use it (the real package, in a copy)."""

from pathlib import Path

import pytest
from pipeline_copy import copy_pipeline

from thesis_lib.foundation.provenance import Sources

STUDY = {"ch3_identify", "ch3_evaluate", "ch3_figures"}
DRAWN = {"ch2_table_2_1", "ch3_figures", "ch3_schematics", "ch3_trajectories"}
UNDRAWN = {"ch2_noise", "ch3_identify", "ch3_evaluate", "find_impacts", "simulate_drops", "claims", "provenance"}
CRITIQUE = {"ch4_dice", "ch4_learn", "ch4_named_physics", "critique", "critique_proof", "ch2_hidden"}
# captions and findings are read by these alone: a new caption draws no figure anew
RECORDED = {"findings", "chapter_report", "run_report"}
RATIOS = {"ch2_impact_forces", "ch2_measured_ratio", "ch2_measured_ratios"}
# edited file, scripts that must run again, scripts that must not (None: all others)
EDITS = [
    ("simulate/stepping/drops.py", {"simulate_drops"}, {"find_impacts", "ch3_identify", "ch2_noise"}),
    (
        "simulate/stepping/lcp.py",
        {"simulate_drops", "ch2_noise", "ch2_programs"},
        {"find_impacts", "ch3_identify", "ch2_gather", "ch2_table_2_1", "claims", "provenance"},
    ),
    ("thesis/figures/chapter2/noise.py", {"ch2_table_2_1"}, None),
    ("datasets/impacts/detect.py", CRITIQUE | RATIOS | {"find_impacts"}, None),
    ("thesis/records/chapter3.py", RECORDED, None),
    ("thesis/records/chapter3.yaml", RECORDED, None),
    ("thesis/ledger/evaluate.py", {"claims"}, None),
    ("thesis/ledger/result.py", {"claims"}, None),
    ("thesis/impact_study/stored_predictions.py", {"ch3_published"}, None),
    ("figures/thesis.mplstyle", DRAWN | {"critique", "critique_proof"}, UNDRAWN),
    ("figures/style.py", DRAWN | {"critique", "critique_proof"}, UNDRAWN),
    ("thesis/figures/chapter3/errors.py", {"ch3_figures", "ch4_figures", "ch4_named_figure"}, None),
    (
        "contact/mirtich.py",
        {"ch3_identify", "ch3_evaluate", "ch3_published", "ch3_figures"},
        {
            "ch3_trajectories",  # shows no law
            "simulate_drops",
            "find_impacts",
            "convert_measured",
            "claims",
            "provenance",
            "datasets_present",
        },
    ),
    ("figures/law_style.py", {"ch3_figures", "ch3_schematics", "critique", "critique_proof"}, UNDRAWN),
    ("effects/adhesion.py", CRITIQUE | RATIOS | {"ch4_named_figure"}, None),
    ("critique/likelihood/fit.py", CRITIQUE, None),
    ("report/critique/page.py", {"critique"}, None),
    (
        "coefficients/individual.py",
        {"ch3_identify"},
        {"simulate_drops", "find_impacts", "convert_measured", "ch3_published", "claims", "provenance"},
    ),
    ("datasets/format/impacts.py", STUDY | {"find_impacts"}, {"datasets_present", "claims", "provenance"}),
    ("bodies/shapes.py", STUDY | {"simulate_drops", "find_impacts"}, {"datasets_present", "claims", "provenance"}),
    ("thesis/config.py", set(), None),  # each script reads the settings of its own section
    ("thesis/commands/claims.py", set(), None),
    ("commands/datasets.py", set(), None),
]


def hashes(root: Path) -> dict[str, str]:
    sources = Sources(root)
    return {path.stem: sources.lib_hash(path) for path in sorted((root / "workflow/scripts").glob("*/*.py"))}


@pytest.fixture(scope="module")
def root(tmp_path_factory) -> Path:
    return copy_pipeline(tmp_path_factory.mktemp("hashes"))


@pytest.fixture(scope="module")
def before(root) -> dict[str, str]:
    return hashes(root)


def changed(root: Path, before: dict[str, str], path: str, edit) -> set[str]:
    file = root / "thesis_lib" / path
    old = file.read_text(encoding="utf-8") if file.exists() else None
    try:
        file.write_text(edit(old or ""), encoding="utf-8")
        after = hashes(root)
    finally:
        file.unlink() if old is None else file.write_text(old, encoding="utf-8")
    return {name for name in before if before[name] != after[name]}


@pytest.mark.parametrize(("path", "users", "others"), EDITS, ids=[edit[0] for edit in EDITS])
def test_edit_reaches_its_users_only(root, before, path, users, others):
    found = changed(root, before, path, lambda text: text + "\n_edited = 1\n")
    assert users <= found
    if others is None:
        assert found == users
    else:
        assert not found & others


def test_a_new_law_reaches_what_goes_through_the_list_of_laws(root, before):
    found = changed(root, before, "contact/new_law.py", lambda _: "LAW = None\n")
    assert found >= STUDY | CRITIQUE
    use_a_module = changed(root, before, "contact/law.py", lambda text: text + "\n_edited = 1\n")
    assert use_a_module - found >= RATIOS
    assert "find_impacts" not in found


def test_a_new_effect_and_a_new_record_reach_what_lists_them(root, before):
    assert changed(root, before, "effects/new_effect.py", lambda _: "EFFECT = None\n") >= CRITIQUE | RATIOS
    assert changed(root, before, "thesis/records/new_record.py", lambda _: "RECORDS = ()\n") == RECORDED


def test_comments_reach_nothing(root, before):
    for path in ("contact/law.py", "foundation/files.py", "datasets/format/impacts.py"):
        assert changed(root, before, path, lambda text: text + "\n# a comment\n") == set()


def test_every_script_uses_the_library(before):
    assert len(set(before.values())) == len(before)
