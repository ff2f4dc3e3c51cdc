"""Intermediates of the pipeline: small valid samples, and what reads them between rules."""

import io
import itertools
import json
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd

from tests.fuzz.mutations import Sample
from thesis_lib.foundation.errors import UserError

ROOT = Path(__file__).resolve().parents[2]


def csv_of(table: pd.DataFrame) -> bytes:
    return table.to_csv(index=False).encode()


def parquet_of(table: pd.DataFrame) -> bytes:
    out = io.BytesIO()
    table.to_parquet(out, index=False)
    return out.getvalue()


def results_samples() -> list[Sample]:
    table = pd.DataFrame({"law": ["mirtich", "newton"], "mu": [0.1, np.nan], "error": [1.0, 2.0], "n": [3, 4]})
    lines = (ROOT / "config/proof/law.csv").read_bytes().splitlines(keepends=True)
    error = {"base": 0.3, "augmented": 0.1, "noise_floor": 0.05, "irb_bound": None}
    law = {"name": "mirtich", "parameters": {"mu": {"value": 0.1, "std": 0.01, "unit": "1"}}}
    effect = {"name": "com_offset", "parameters": {"c_x": {"value": 1e-3, "std": 1e-4, "unit": "m"}}}
    run = {"schema": 1, "dataset": "drops", "verdict": "effects", "base_model": law, "error": error}
    run |= {"augmented_model": law, "effects": [effect], "n_impacts": 10, "n_trials": 10}
    return [
        {"table.csv": csv_of(table)},
        {"diagnosis.json": json.dumps(run, indent=1).encode()},
        {"law.csv": b"".join(lines[:3])},
    ]


def read_results(folder: Path, out: Path) -> None:
    """Intermediates between rules: what is wrong is named with the remedy."""
    from thesis_lib.commands.comparison import compare, read_run
    from thesis_lib.foundation.files import read_table
    from thesis_lib.studies.proof.results import outcomes, recovered

    try:
        if (folder / "diagnosis.json").exists():
            run = read_run(folder)
            compare(run, run)
        elif (folder / "law.csv").exists():
            outcomes(folder)
            recovered(folder)
        else:
            read_table(folder / "table.csv", ["law", "mu", "error", "n"])
    except UserError as error:
        assert "again" in str(error) or "run the rule" in str(error) or "unfinished" in str(error), error
        raise


def jenga_samples() -> list[Sample]:
    from thesis_lib.jenga.play.game import Attempt, Game, write_game
    from thesis_lib.jenga.robot.samples import ACTION, CONTEXT, STATE

    n = np.arange(6)
    table = pd.DataFrame({"push": 0, "step": n, "tower": 1, "block": 2})
    values = {"x": 0.1, "y": 0.0, "yaw": 0.0, "f_n": 0.2, "f_t": 0.0, "advance": 1.0 * n, "tower": 0.0}
    table = table.assign(**{f"{letter}_{name}": values[name] for letter in "sn" for name in STATE})
    table = table.assign(**{f"a_{name}": 0.0 for name in ACTION}, **{f"c_{name}": 0.0 for name in CONTEXT}, truth=0)
    game = Game("rule", 1, 2, 54, [Attempt(3, 1, 0, pushed=1)], "done")
    with tempfile.TemporaryDirectory() as made:
        write_game(game, Path(made) / "game.json")
        content = (Path(made) / "game.json").read_bytes()
    return [{"samples.csv": csv_of(table)}, {"game.json": content}]


def read_jenga(folder: Path, out: Path) -> None:
    from thesis_lib.jenga.play.game import read_game
    from thesis_lib.jenga.robot.samples import read_samples

    if (folder / "game.json").exists():
        read_game(folder / "game.json")
    else:
        read_samples(folder / "samples.csv")


def policy_samples() -> list[Sample]:
    import torch

    from thesis_lib.jenga.play.settings import PpoSettings

    settings = PpoSettings()
    widths = [9, *settings.hidden]
    weights = {}
    for i, (a, b) in enumerate(itertools.pairwise(widths)):
        weights[f"mlp_extractor.policy_net.{2 * i}.weight"] = torch.zeros(b, a)
        weights[f"mlp_extractor.policy_net.{2 * i}.bias"] = torch.zeros(b)
    weights |= {"action_net.weight": torch.zeros(2, widths[-1]), "action_net.bias": torch.zeros(2)}
    state = {"schema": 2, "samples": 100, "settings": settings.model_dump_json(), "policy": weights}
    state |= {"episodes": torch.zeros(3, 5), "ends": torch.zeros(3)}
    out = io.BytesIO()
    torch.save(state, out)
    return [{"policy.pt": out.getvalue()}]


def read_policy(folder: Path, out: Path) -> None:
    from thesis_lib.jenga.play.ppo import read_policy

    read_policy(folder / "policy.pt")
