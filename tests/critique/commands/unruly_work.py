"""What a batch may be given to do: work that ends in every way there is, by the name of the dataset."""

import ctypes
import json
import os
import signal
import time
from pathlib import Path

from thesis_lib.foundation.errors import UserError

DIAGNOSIS = {
    "schema": 1,
    "verdict": "effects",
    "n_impacts": 7,
    "base_model": {"name": "mirtich", "parameters": {}},
    "augmented_model": {"name": "whittaker", "parameters": {}},
    "effects": [
        {"name": "com_offset", "parameters": {}, "indistinguishable_from": ["tilt"]},
        {"name": "drift", "parameters": {}, "indistinguishable_from": []},
    ],
    "error": {"base": 0.5, "augmented": 0.25, "noise_floor": None},
}


def unruly(path: str, folder: str, seed: int, effects: tuple[str, ...] | None) -> dict:
    """Do what the first word of the dataset's name says; folder.pid tells in which process."""
    Path(f"{folder}.pid").write_text(str(os.getpid()))
    print("at work on", Path(path).name)
    match Path(path).name.split("_")[0]:
        case "refused":
            raise UserError("The table\n  is \x1b[31mempty")
        case "crash":
            raise RuntimeError("a defect")
        case "segfault":
            ctypes.string_at(0)
        case "killed":
            os.kill(os.getpid(), signal.SIGKILL)
        case "silent":
            os._exit(3)
        case "greedy":
            taken = []
            while True:
                taken.append(b"\x01" * 50_000_000)
        case "hang":
            time.sleep(600)
        case "nothing":
            return {}  # and no diagnosis.json
        case "good":
            made = Path(folder)
            made.mkdir(exist_ok=True)
            for name in ("model.json", "report.html"):
                (made / name).write_text(f"{seed}")
            (made / "diagnosis.json").write_text(json.dumps(DIAGNOSIS | {"seed": seed}))
            return {}
    raise AssertionError(path)


if __name__ == "__main__":
    import sys

    from unruly_work import unruly as work  # so that its processes find it by this name

    from thesis_lib.commands.batch import run_batch

    run_batch(sys.argv[2:], sys.argv[1], 0, jobs=2, work=work)
