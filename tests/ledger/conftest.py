"""A small synthetic ledger with a claim of each kind, and a results folder that reproduces all of it."""

import json
from copy import deepcopy

import pytest
import yaml

from thesis_lib.thesis.ledger.evaluate import evaluate
from thesis_lib.thesis.ledger.format import Ledger

TABLE = """\
law,coded,mu,mu_std,share,failed,converged,n
mirtich,as_published,0.065,0.002,17,3,true,100
mirtich,as_defined,0.101,0.002,15,0,true,100
whittaker,as_published,0.111,0.004,31,0,false,1718
newton,as_published,0.084,0.003,25,0,1,0.001
"""

PUBLISHED = {"coded": "as_published"}


def claim(name, check, published=None, where=None, column="mu", **more):
    """A claim about the synthetic table, as it stands in YAML."""
    where = {"law": "mirtich", **PUBLISHED} if where is None else where
    source = {"file": "chapter3/table.csv", "where": where, "column": column, "std_column": "mu_std"}
    entry = {
        "id": f"table_3_1.{name}",
        "chapter": 3,
        "location": f"Table 3.1, {name}",
        "statement": f"A statement about {name}.",
        "source": source,
        "check": check,
        "needs": ["planar_impact"],
        **more,
    }
    return entry if published is None else {**entry, "published": published}


def every_kind():
    """One claim of each kind, all of which hold for `TABLE`."""
    return [
        claim("abs", {"kind": "abs", "tolerance": 0.01, "reason": "rounding and noise"}, 0.062),
        claim("rel", {"kind": "rel", "tolerance": 0.05, "reason": "rounding and noise"}, 0.062),
        claim("interval", {"kind": "interval", "k": 2, "reason": "95 % of a Gaussian"}, 0.062),
        claim("greater", {"kind": "greater", "threshold": 0.05, "k": 3, "reason": "99.7 %"}),
        claim("less", {"kind": "less", "threshold": 0.3, "reason": "the inclined plane"}, 0.062),
        claim(
            "ordering",
            {"kind": "ordering", "key": "law", "rows": ["mirtich", ["newton", "whittaker"]]},
            where=PUBLISHED,
        ),
        claim("argmax", {"kind": "argmax", "key": "law", "row": "whittaker"}, where=PUBLISHED),
        claim("argmin", {"kind": "argmin", "key": "law", "row": "mirtich"}, where=PUBLISHED),
        claim("true", {"kind": True}, column="converged"),
    ]


@pytest.fixture
def make_claim():
    return claim


@pytest.fixture
def entries():
    return deepcopy(every_kind())


@pytest.fixture
def write_ledger(tmp_path):
    """Write claims (as dictionaries) to a YAML file; returns its path."""

    def write(claims, name="claims.yaml", **more):
        path = tmp_path / name
        path.write_text(yaml.safe_dump({"schema": 1, "claims": claims, **more}), encoding="utf-8")
        return path

    return write


@pytest.fixture
def results(tmp_path):
    """A results folder with the table and the list of datasets."""
    folder = tmp_path / "results"
    (folder / "chapter3").mkdir(parents=True)
    (folder / "datasets").mkdir()
    (folder / "chapter3" / "table.csv").write_text(TABLE, encoding="utf-8")
    datasets = {"planar_impact": {"present": True, "trials": 1718}, "drops": {"present": True}}
    (folder / "datasets" / "present.json").write_text(json.dumps(datasets), encoding="utf-8")
    return folder


@pytest.fixture
def judged(results):
    """The results of claims (as dictionaries) on the table."""

    def judge(claims, present=None, scale=""):
        present = {"planar_impact": True, "drops": True} if present is None else present
        return evaluate(Ledger.model_validate({"schema": 1, "claims": claims}), results, present, scale)

    return judge


@pytest.fixture
def edit_table(results):
    """Replace text in the results table."""

    def edit(old, new):
        path = results / "chapter3" / "table.csv"
        text = path.read_text(encoding="utf-8")
        assert old in text
        path.write_text(text.replace(old, new), encoding="utf-8")

    return edit
