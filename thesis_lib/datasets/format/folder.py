"""The folder that holds a dataset or a recording, before anything in it is read."""

from pathlib import Path

from thesis_lib.datasets.format.validate import DatasetError, Problem


def checked_folder(path: str | Path, content: str) -> tuple[Path, str]:
    """The folder at `path` and its name, which results carry; `content` is what it must hold, for the message.

    Raises:
        DatasetError: there is no such folder, or its name holds characters that do not print.
    """
    folder = Path(path)
    try:
        name, is_folder, there = folder.resolve().name, folder.is_dir(), folder.exists()
    except (OSError, ValueError, RuntimeError) as error:  # a loop of links, an impossible file name
        what = f"cannot be opened ({getattr(error, 'strerror', None) or error})"
        raise DatasetError(folder.name, [Problem(str(path), "", what, "check the path")]) from error
    if not is_folder:
        what = "is a file, expected a folder" if there else "the folder does not exist"
        raise DatasetError(name, [Problem(str(path), "", what, f"give the folder that holds {content}")])
    if not name.isprintable():
        # results carry the name: JSON and HTML hold only valid text, and a terminal obeys control characters
        what = f"the folder's name {name!a} holds characters that do not print"
        raise DatasetError(ascii(name)[1:-1], [Problem(ascii(str(path)), "", what, "rename the folder")])
    return folder, name
