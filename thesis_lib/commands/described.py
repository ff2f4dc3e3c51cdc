"""Description of a folder with a dataset or a recording, as printed by `datasets check` and similar commands."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from thesis_lib.datasets.format.dataset import Dataset


def described(folder: str | Path, as_json: bool = False, compare: bool = False) -> str:
    """Describe the content of a folder as text or JSON; DatasetError lists everything that is wrong in it.

    `compare`: also compare the stated pose of the tracked frame with the estimate from tosses in space.
    """
    from thesis_lib.datasets.recordings.recording import is_recording, read_recording, recording_facts, recording_text
    from thesis_lib.datasets.summary import check_dataset, summarise, summary_text

    moves = is_recording(folder)
    read: tuple = (read_recording(folder),) if moves else check_dataset(folder)
    if not moves and not read[0].space.is_plane:
        read = (read[0], None, hits_told(read[0], compare))
    if not as_json:
        return (recording_text if moves else summary_text)(*read)
    facts = (recording_facts if moves else summarise)(*read)
    return json.dumps({"valid": True, "problems": [], **facts}, ensure_ascii=False, allow_nan=False)


def hits_told(dataset: "Dataset", compare: bool = False) -> dict:
    """Summary of the hits in a dataset in space that a critique would use, ready for JSON.

    Keys `used` (single hits and episodes), `hits` (in these), `trials`, `by_contact` (of those that `hard_hits` keeps),
    `left_out` (reason -> kind of contact -> count), `elsewhere` (trial and time in s of hits off the surface),
    `warnings`, `tracked` (a sentence, or none); `why`, if no hit can be used.
    """
    import numpy as np

    from thesis_lib.critique.likelihood.in_space.hits import hard_hits, observe_in_space
    from thesis_lib.datasets.checks.tracked_pose import settled, tracked_frame_told
    from thesis_lib.datasets.sources.along_throws import hidden_drift
    from thesis_lib.foundation.errors import UserError

    told: dict = {"tracked": tracked_frame_told(dataset, compare)}
    try:
        o = observe_in_space(settled(dataset))
    except UserError as error:
        return told | {"used": 0, "why": str(error)}
    hits, out = hard_hits(o), o.found.left_out
    used = hits["kind"][hits["row"] >= 0]
    off = out[out["reason"] == "off_surface"]
    reasons = {
        reason: of["kind"].replace("", "any").value_counts().sort_index().to_dict()
        for reason, of in out.groupby("reason")
    }
    return told | {
        "used": len(o),
        "hits": int(o.hits.sum()),
        "trials": len(np.unique(o.trial)),
        "by_contact": {kind: int((used == kind).sum()) for kind in ("corner", "edge", "face") if len(hits)},
        "left_out": reasons,
        "elsewhere": list(zip(off["trial"].tolist(), off["t"].tolist())),
        "warnings": [*o.found.warnings, *filter(None, [hidden_drift(dataset)])],
    }
