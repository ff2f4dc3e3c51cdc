"""What is written is read back, to the last bit where that is asked for."""

import string

import numpy as np
import pytest
from folders import impacts, trajectories, write
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from thesis_lib.datasets import read_dataset
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.write import write_dataset
from thesis_lib.foundation.errors import UserError

FORMAT_ERROR = 5e-9  # relative: half a unit in the ninth digit, the default float format
QUICK = settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@st.composite
def datasets(draw) -> Dataset:
    finite = {"allow_nan": False, "allow_infinity": False}
    size = st.floats(0.01, 0.5, **finite)
    shape = draw(
        st.one_of(
            st.builds(lambda a, b: {"kind": "ellipse", "semi_axes": [a, b]}, size, size),
            st.builds(lambda a: {"kind": "disk", "radius": a}, size),
            st.builds(lambda a, b: {"kind": "polygon", "vertices": [[a, -b], [0, b], [-a, -b]]}, size, size),
        )
    )
    content = {
        "schema": 1,
        "description": draw(st.text(alphabet=string.printable + "äθ:#'\"", max_size=40)),
        "body": {"shape": shape, "radius_of_gyration": draw(st.floats(1e-3, 0.01, **finite))},
        "gravity": draw(st.floats(5.0, 20.0, **finite)),
    }
    if draw(st.booleans()):
        content["body"]["mass"] = draw(st.floats(1e-3, 0.01, **finite))
    if draw(st.booleans()):
        content["noise"] = {"position": draw(st.floats(1e-6, 1e-3, **finite))}
    trials = draw(st.lists(st.integers(-(2**53), 2**53), min_size=1, max_size=4, unique=True))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    poses = trajectories(len(trials), draw(st.integers(10, 20)))
    poses["trial"] = np.asarray(trials)[poses["trial"]]
    for name in ("x", "y", "theta"):
        poses[name] += rng.normal(0.0, 1e-3, len(poses))
    poses["y"] += 1.0
    hits = impacts(len(trials), 2)
    hits["trial"] = np.asarray(trials)[hits["trial"]]
    hits["theta"] += rng.normal(0.0, 1.0, len(hits))
    which = draw(st.sampled_from(["both", "poses", "impacts"]))
    return Dataset(
        "any", Header.model_validate(content), None if which == "impacts" else poses, None if which == "poses" else hits
    )


@given(dataset=datasets())
@QUICK
def test_round_trip(dataset, tmp_path_factory):
    for float_format, tolerance in (("%.9g", FORMAT_ERROR), (None, 0.0)):
        folder = write_dataset(dataset, tmp_path_factory.mktemp("round") / "any", float_format)
        back = read_dataset(folder)
        assert back.header == dataset.header
        for ours, theirs in ((dataset.trajectories, back.trajectories), (dataset.impacts, back.impacts)):
            assert (ours is None) == (theirs is None)
            if ours is not None:
                assert list(ours.columns) == list(theirs.columns)
                np.testing.assert_array_equal(ours["trial"], theirs["trial"])
                np.testing.assert_allclose(theirs.to_numpy(float), ours.to_numpy(float), rtol=tolerance, atol=0.0)
        if float_format is None:
            assert back.digest() == dataset.digest()
            # and once more: written again, the same bytes
            again = write_dataset(back, tmp_path_factory.mktemp("again") / "any", None)
            for path in folder.iterdir():
                assert (again / path.name).read_bytes() == path.read_bytes()


def test_stale_tables_are_not_mixed_in(tmp_path):
    dataset = read_dataset(write(tmp_path / "a", trajectories=trajectories(), impacts=impacts(3, 1)))
    write_dataset(dataset, tmp_path / "b")
    write_dataset(dataset, tmp_path / "b")  # replaces itself
    only_poses = Dataset("b", dataset.header, dataset.trajectories)
    with pytest.raises(UserError, match=r"impacts\.csv already exists"):
        write_dataset(only_poses, tmp_path / "b")
