"""Fetch genuine drives, check their axes by physics, write them as recordings.

    PYTHONPATH=tests python -m genuine.fetch FOLDER [--from DOWNLOADED] [--only NAME ...]

The recordings belong to others: they are written to FOLDER and are not part of this project.
"""

from __future__ import annotations

import argparse
import hashlib
import http.client
import io
import sys
import urllib.error
import urllib.parse
import urllib.request
import zipfile
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from motion_clients.recording import read_recording

from .drive import RefusedError
from .sources import SOURCES, Source

RAW: Final = "https://raw.githubusercontent.com"
ARCHIVE: Final = "https://codeload.github.com"
_TIMEOUT_S: Final = 60.0


class FetchError(Exception):
    """Files of a source are missing, or are not those of its commit."""


def download(source: Source, root: Path, raw: str = RAW, archive: str = ARCHIVE) -> None:
    """Download those files of `source` to `root` that are not there yet.

    Raises:
        FetchError: They cannot be downloaded.
    """
    wanted = source.files
    if source.many:
        # one archive serves every drive of its repository
        same = [
            s for s in SOURCES if (s.repository, s.commit) == (source.repository, source.commit)
        ]
        wanted = tuple(dict.fromkeys((*wanted, *(name for s in same for name in s.files))))
    missing = [name for name in wanted if not (root / source.folder / name).is_file()]
    if not missing:
        return
    if source.many:
        data = _get(f"{archive}/{source.repository}/zip/{source.commit}", source, root)
        try:
            packed = zipfile.ZipFile(io.BytesIO(data))
            top = packed.namelist()[0].partition("/")[0]
            contents = {name: packed.read(f"{top}/{name}") for name in missing}
        except (zipfile.BadZipFile, KeyError, IndexError) as error:
            raise FetchError(
                f"{source.name}: the archive of {source.repository} at {source.commit} is damaged "
                f"or lacks a file ({error}); try again"
            ) from error
    else:
        contents = {}
        for name in missing:
            path = urllib.parse.quote(f"{source.repository}/{source.commit}/{name}")
            contents[name] = _get(f"{raw}/{path}", source, root)
    for name, content in contents.items():
        place = root / source.folder / name
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(content)


def _get(address: str, source: Source, root: Path) -> bytes:
    try:
        with urllib.request.urlopen(address, timeout=_TIMEOUT_S) as answer:
            content: bytes = answer.read()
            return content
    except (OSError, http.client.HTTPException) as error:
        # URLError and HTTPError are OSErrors
        raise FetchError(
            f"{source.name}: no answer from {address} ({error}). Check the network, or download "
            f"https://github.com/{source.repository} at commit {source.commit} elsewhere, put its "
            f"files into {root / source.folder} and call this with --from {root}"
        ) from error


def verify(source: Source, root: Path) -> None:
    """Check that the files of `source` under `root` are those of its commit.

    Raises:
        FetchError: One is missing, or their checksum differs.
    """
    digest = checksum(source, root)
    if digest != source.sha256:
        raise FetchError(
            f"{source.name}: sha256 of {len(source.files)} file(s) in {root / source.folder} is "
            f"{digest}, expected {source.sha256}: another commit than {source.commit}, or a "
            "damaged download; delete the files and fetch them again"
        )


def checksum(source: Source, root: Path) -> str:
    """Sha256 of all files of `source`, one after the other.

    Raises:
        FetchError: One is missing.
    """
    digest = hashlib.sha256()
    for name in source.files:
        place = root / source.folder / name
        try:
            digest.update(place.read_bytes())
        except OSError as error:
            raise FetchError(
                f"{source.name}: {place} cannot be read ({error.strerror}); put the files of "
                f"https://github.com/{source.repository} at commit {source.commit} into "
                f"{root / source.folder}"
            ) from error
    return digest.hexdigest()


def make(source: Source, root: Path, folder: Path) -> list[str]:
    """Convert verified files under `root`, write the CSV into `folder`, return a report.

    Raises:
        RefusedError: The recording contradicts physics.
    """
    drive = source.convert(root)
    path = folder / f"{source.name}.csv"
    drive.write(path)
    warnings = [f"warning: {warning}" for warning in read_recording(path).warnings]
    size = [
        f"{name} rms {float((drive.columns[name] ** 2).mean() ** 0.5):.2f} "
        f"peak {float(abs(drive.columns[name]).max()):.1f}"
        for name in ("ax", "ay", "az")
    ]
    head = f"{path}: {drive.seconds:.0f} s, {source.vehicle}; {', '.join(size)} m/s^2"
    return [head, *(f"    {line}" for line in (*drive.proof.lines(), *warnings))]


def main(arguments: Iterable[str] | None = None) -> int:
    """Fetch and convert; 1 when a drive could not be made."""
    parser = argparse.ArgumentParser(prog="genuine.fetch", description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path, help="where the CSV files go")
    parser.add_argument("--from", dest="given", type=Path, help="folder of downloaded files")
    parser.add_argument("--only", nargs="+", choices=[source.name for source in SOURCES])
    options = parser.parse_args(None if arguments is None else list(arguments))
    options.folder.mkdir(parents=True, exist_ok=True)
    root = options.given or options.folder / "downloaded"
    failures = 0
    for source in SOURCES:
        if options.only and source.name not in options.only:
            continue
        try:
            if options.given is None:
                download(source, root)
            verify(source, root)
            print("\n".join(make(source, root, options.folder)))
        except RefusedError as error:
            failures += 1
            print(f"{source.name}: refused: {error}", file=sys.stderr)
        except FetchError as error:
            failures += 1
            print(error, file=sys.stderr)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
