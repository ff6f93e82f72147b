import hashlib
import http.server
import io
import threading
import zipfile
from dataclasses import replace
from functools import partial

import pytest
from motion_clients.recording import read_recording

from . import fetch, readers
from .drive import Drive, Proof, RefusedError
from .fetch import FetchError
from .motion import drive
from .sources import SOURCES, Source
from .test_formats import write_ferrari

NAMES = ("t", "axCG", "ayCG", "vx", "vy", "yawRate")
COMMIT = "0" * 40


@pytest.fixture
def source(tmp_path):
    """A source whose files lie in `tmp_path/given`."""
    folder = tmp_path / "given" / "someone+drives" / "a lap"
    folder.mkdir(parents=True)
    write_ferrari(folder, drive(100.0))
    digest = hashlib.sha256(b"".join((folder / f"{name}.txt").read_bytes() for name in NAMES))
    return Source(
        name="lap",
        repository="someone/drives",
        commit=COMMIT,
        files=tuple(f"a lap/{name}.txt" for name in NAMES),
        sha256=digest.hexdigest(),
        read=readers.ferrari,
        place="a lap",
        vehicle="car",
        sensor="100 Hz",
        licence="none",
    )


@pytest.fixture
def server(tmp_path):
    """Serves `tmp_path/public`."""
    folder = tmp_path / "public"
    folder.mkdir()

    class Handler(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

    with http.server.ThreadingHTTPServer(
        ("127.0.0.1", 0), partial(Handler, directory=str(folder))
    ) as running:
        thread = threading.Thread(target=running.serve_forever)
        thread.start()
        yield folder, f"http://127.0.0.1:{running.server_port}"
        running.shutdown()
        thread.join()


def test_make_writes_a_recording_that_reads_without_warnings(source, tmp_path):
    fetch.verify(source, tmp_path / "given")
    lines = fetch.make(source, tmp_path / "given", tmp_path)
    recording = read_recording(tmp_path / "lap.csv")
    assert recording.warnings == ()
    assert not any("warning" in line for line in lines)
    # the brake at 40 to 44 s
    braking = recording.samples[4200]
    assert braking.acceleration[0] == pytest.approx(-3.0, abs=0.05)


def test_download_raw_files_are_those_of_the_commit(source, server, tmp_path):
    public, address = server
    given = tmp_path / "given" / "someone+drives" / "a lap"
    place = public / "someone" / "drives" / COMMIT
    place.mkdir(parents=True)
    given.rename(place / "a lap")
    fetch.download(source, tmp_path / "root", raw=address)
    fetch.verify(source, tmp_path / "root")


def test_download_many_files_come_from_one_archive(source, server, tmp_path):
    public, address = server
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for name in source.files:
            content = (tmp_path / "given" / "someone+drives" / name).read_bytes()
            archive.writestr(f"drives-{COMMIT}/{name}", content)
    place = public / "someone" / "drives" / "zip"
    place.mkdir(parents=True)
    (place / COMMIT).write_bytes(packed.getvalue())
    fetch.download(replace(source, many=True), tmp_path / "root", archive=address)
    fetch.verify(source, tmp_path / "root")


def test_download_damaged_archive_names_repository(source, server, tmp_path):
    public, address = server
    place = public / "someone" / "drives" / "zip"
    place.mkdir(parents=True)
    (place / COMMIT).write_bytes(b"not a zip")
    with pytest.raises(FetchError, match="archive of someone/drives"):
        fetch.download(replace(source, many=True), tmp_path / "root", archive=address)


def test_download_unknown_file_says_what_to_do(source, server, tmp_path):
    _, address = server
    with pytest.raises(FetchError, match=r"404.*--from"):
        fetch.download(source, tmp_path / "root", raw=address)


def test_download_no_server_says_what_to_do(source, tmp_path):
    # discard port of this machine: no server, or one without these files
    with pytest.raises(FetchError, match=r"Check the network.*someone\+drives"):
        fetch.download(source, tmp_path / "root", raw="http://127.0.0.1:9")


def test_verify_changed_file_is_an_error(source, tmp_path):
    with (tmp_path / "given" / "someone+drives" / source.files[1]).open("a") as handle:
        handle.write("0\n")
    with pytest.raises(FetchError, match=f"expected {source.sha256}"):
        fetch.verify(source, tmp_path / "given")


def test_verify_missing_file_names_it(source, tmp_path):
    (tmp_path / "given" / "someone+drives" / source.files[1]).unlink()
    with pytest.raises(FetchError, match=r"axCG\.txt cannot be read"):
        fetch.verify(source, tmp_path / "given")


def test_main_missing_files_are_reported(tmp_path, capsys):
    given = tmp_path / "empty"
    given.mkdir()
    assert fetch.main([str(tmp_path), "--from", str(given), "--only", "car_dresden"]) == 1
    assert "2014-03-26-000-Data.csv cannot be read" in capsys.readouterr().err


def test_proof_small_correlation_is_refused():
    proof = Proof({"forward": (0.79, 1.0)})
    with pytest.raises(RefusedError, match=r"correlation 0\.790"):
        proof.require("forward")


def test_drive_rows_are_written_in_order(tmp_path):
    made = Drive({"ax": drive(100.0).forward[:3], "v": drive(100.0).speed[:3]}, Proof({}))
    made.write(tmp_path / "x.csv")
    assert (tmp_path / "x.csv").read_text("ascii").splitlines()[:2] == ["t,ax,v", "0.00,0.000,0.00"]


def test_sources_names_and_commits_are_fixed():
    assert len({source.name for source in SOURCES}) == len(SOURCES)
    for source in SOURCES:
        assert len(source.commit) == 40
        assert len(source.sha256) == 64
