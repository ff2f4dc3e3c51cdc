"""The confusion table of the proof: truth against verdict, with intervals."""

import json
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from thesis_lib.critique.proof import NOTHING, SEEDS, STORE, Case, run
from thesis_lib.errors import UserError
from thesis_lib.simulate.mechanisms import CAUSES


def confusion(store: Path = STORE) -> pd.DataFrame:
    """A row per source, truth, size and noise: how often the verdict was right, with Wilson intervals, and how well.

    `right` is the share in which the hidden effect stood first or in the group named first; for nothing hidden it is
    the share of `adequate`, and for causes outside the library that of `unexplained`.
    """
    cells: dict[tuple, list[dict]] = {}
    for path in sorted(store.rglob("*.json")):
        result = json.loads(path.read_text(encoding="utf-8"))
        cells.setdefault((result["source"], result["truth"], result["drops"], result["noise"]), []).append(
            result
        )
    rows = []
    for (source, truth, drops, noise), results in sorted(cells.items()):
        outside = source == "mechanism" and truth != NOTHING and not CAUSES[truth].effects
        wanted = "adequate" if truth == NOTHING else "unexplained"
        good = [
            r["verdict"] == wanted if truth == NOTHING or outside else bool(r.get("right")) for r in results
        ]
        low, high = _wilson(sum(good), len(good))
        steps = [r["steps"] for r in results if r.get("steps")]
        named: dict[str, int] = {}
        for one in steps:
            named[one[0][0]] = named.get(one[0][0], 0) + 1
        judged = [r["error"] for r in results if "error" in r]
        inside = [
            abs(p["found"] - p["true"]) <= 1.96 * p["std"]
            for r in results
            for p in r.get("parameters", {}).values()
        ]
        rows.append(
            {
                "source": source,
                "truth": truth,
                "drops": drops,
                "noise": noise,
                "n": len(results),
                "right": np.mean(good),
                "right_low": low,
                "right_high": high,
                "group_size": np.mean([len(one[0]) for one in steps]) if steps else np.nan,
                "named_first": ";".join(
                    f"{k}:{v}" for k, v in sorted(named.items(), key=lambda i: (-i[1], i[0]))
                ),
                "verdicts": ";".join(
                    f"{v}:{sum(r['verdict'] == v for r in results)}"
                    for v in ("adequate", "effects", "unexplained", "refused")
                    if any(r["verdict"] == v for r in results)
                ),
                "error_before": np.median([e["base"] for e in judged]) if judged else np.nan,
                "error_after": np.median([e["augmented"] for e in judged]) if judged else np.nan,
                "floor": np.median([e["floor"] for e in judged]) if judged else np.nan,
                "coverage": np.mean(inside) if inside else np.nan,
            }
        )
    return pd.DataFrame(rows)


def _wilson(k: int, n: int, z: float = 1.96) -> tuple[float, float]:
    share, centre = k / n, (k + 0.5 * z * z) / (n + z * z)
    half = z / (n + z * z) * np.sqrt(n * share * (1 - share) + 0.25 * z * z)
    return max(0.0, float(centre - half)), min(1.0, float(centre + half))


def rerun(cases: Sequence[str], store: Path = STORE) -> pd.DataFrame:
    """Run the first dataset of each "source/truth" again and compare what it says with what is stored.

    Raises:
        UserError: a verdict, or the effect named first, is not the stored one.
    """
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for name in cases:
            source, truth = name.split("/")
            case = Case(source, truth, SEEDS)
            stored = json.loads((store / case.path).read_text(encoding="utf-8"))
            again = run(case, Path(folder))
            same = stored["verdict"] == again["verdict"] and stored["steps"][:1] == again["steps"][:1]
            rows.append({"source": source, "truth": truth, "verdict": again["verdict"], "agrees": int(same)})
    table = pd.DataFrame(rows, columns=["source", "truth", "verdict", "agrees"])
    if not table["agrees"].all():
        changed = table.loc[table["agrees"] == 0, "truth"].tolist()
        raise UserError(
            f"The critique says something else than the stored proof on {', '.join(changed)}. If the change is meant, "
            "delete config/proof and run python -m thesis_lib.critique.proof run again."
        )
    return table
