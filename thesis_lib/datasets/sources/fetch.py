"""Fetch a published dataset, from the network or from a local copy, and convert it.

Nothing from the network is trusted.  Downloads are bounded in size.  Only expected files of an archive are read, and
none is unpacked to a path that the archive chooses.  No byte is parsed before its SHA-256 matches.
"""

import http.client
import re
import tempfile
import urllib.error
import urllib.request
import zipfile
from importlib.util import find_spec
from pathlib import Path, PurePosixPath

from thesis_lib.datasets.sources.published import (
    SOURCES,
    PublishedSet,
    Say,
    checksums,
    convert_files,
    convert_published,
    published_name,
)
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.regular_file import regular_size

RAW_HOST = "https://raw.githubusercontent.com"
ARCHIVE_HOST = "https://codeload.github.com"
TIMEOUT = 60.0  # s without receiving a byte
MAX_DOWNLOAD = 1_000_000_000  # bytes; the archive of the dice repository also holds its meshes and videos
OF_TENSORS = ("contactnets_cube",)  # sets that torch reads
MAX_MEMBER = 1_000_000  # bytes; a dice file has 24 kB
CHUNK = 1 << 20


def fetch(
    name: str,
    to: str | Path,
    source_dir: str | Path | None = None,
    say: Say = lambda text: None,
    note: Say = lambda text: None,
    raw_host: str = RAW_HOST,
    archive_host: str = ARCHIVE_HOST,
) -> Path:
    """Get the published set `name` ('planar-impact', 'planar-dice', …) and convert it into the folder `<to>/<name>`.

    `source_dir` is a local copy to use instead of the network, or its parent folder; `say` is called with lines on
    the progress, `note` with a line on optional files that a copy lacks.  UserError, with nothing written: no network,
    a wrong file, an unsafe archive, or no package that reads the files.
    """
    name = published_name(name)
    if name in OF_TENSORS and find_spec("torch") is None:
        raise UserError(
            f"{name.replace('_', '-')} holds tensors of torch; reading them needs a package: pip install torch."
        )
    out_dir = Path(to) / name
    if source_dir is not None:
        say(f"checking and converting {name} from {source_dir}")
        return convert_published(name, source_dir, out_dir, note)
    source = SOURCES[name]
    with tempfile.TemporaryDirectory() as folder:
        files = {file: Path(folder) / file for file in checksums(name)}
        try:
            if source.archive is None:
                for i, (file, path) in enumerate(source.raw.items(), 1):
                    say(f"[{i}/{len(source.raw)}] {file}")
                    download(f"{raw_host}/{path}", files[file], say)
            else:
                repository, commit = source.archive
                archive = Path(folder) / "archive.zip"
                say(f"archive of {repository} (can be large)")
                download(f"{archive_host}/{repository}/zip/{commit}", archive, say)
                unpack(archive, source, files)
        except (OSError, http.client.HTTPException) as error:
            reason = getattr(error, "reason", None) or error
            raise UserError(
                f"{name.replace('_', '-')} could not be downloaded ({reason}). Check the network, or get the files on "
                f"another machine and run: thesis-lib datasets fetch {name.replace('_', '-')} --from DIR"
            ) from error
        say(f"checking and converting {len(files)} files")
        return convert_files(name, files, out_dir, note)


def download(url: str, path: Path, say: Say = lambda text: None, limit: int = MAX_DOWNLOAD) -> None:
    """Stream `url` into `path`; UserError beyond `limit` bytes.

    OSError or http.client.HTTPException: the network failed, or the connection ended early.
    """
    request = urllib.request.Request(url, headers={"User-Agent": "thesis_lib"})
    done, reported = 0, 0
    with urllib.request.urlopen(request, timeout=TIMEOUT) as answer, path.open("wb") as file:
        expected = answer.headers.get("Content-Length")
        while block := answer.read(CHUNK):
            done += len(block)
            if done > limit:
                raise UserError(f"{url} is larger than {limit:,} bytes, so it is not the expected file.")
            file.write(block)
            if done - reported >= 10 * CHUNK:
                reported = done
                say(f"  {done // CHUNK} MiB" + (f" of {int(expected) // CHUNK} MiB" if expected else ""))
    if expected is not None and done != int(expected):
        raise OSError(f"the connection ended after {done:,} of {expected} bytes")


def unpack(archive: Path, source: PublishedSet, files: dict[str, Path]) -> None:
    """Copy the expected members `<any one folder>/<source.inside>/<file>` of a zip file to `files`.

    UserError if it is not a zip file, or if a member is missing, too large, or has a name that leads out of the folder.
    """
    regular_size(archive, MAX_DOWNLOAD)
    try:
        with zipfile.ZipFile(archive) as zipped:
            members = {}
            for info in zipped.infolist():
                path = PurePosixPath(info.filename)
                if path.is_absolute() or ".." in path.parts or re.search(r"[\\:\x00]", info.filename):
                    raise UserError(f"The archive contains the unsafe name {info.filename!r}; it was not unpacked.")
                _, _, inside = str(path).partition("/")
                file = inside.removeprefix(f"{source.inside}/")
                if file != inside and file in files:
                    if info.file_size > MAX_MEMBER:
                        raise UserError(f"{path.name} in the archive states {info.file_size:,} bytes; not unpacked.")
                    members[file] = info
            if missing := sorted(set(files) - set(members)):
                raise UserError(
                    f"The archive lacks {len(missing)} of {len(files)} files (first: {source.inside}/{missing[0]})."
                )
            for name, info in members.items():
                with zipped.open(info) as member:
                    content = member.read(MAX_MEMBER + 1)  # the stated size may be wrong
                if len(content) > MAX_MEMBER:
                    raise UserError(f"{name} in the archive is larger than {MAX_MEMBER:,} bytes; not unpacked.")
                files[name].parent.mkdir(parents=True, exist_ok=True)
                files[name].write_bytes(content)
    except UserError:
        raise
    except Exception as error:  # the library raises exceptions of many kinds
        raise UserError(f"The downloaded archive is damaged ({error}); fetch it again.") from error
