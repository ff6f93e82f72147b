"""The folder of dumps may hold other files: only dumps of this server are ever deleted."""

from datetime import UTC, datetime

from motionserver.telemetry.blackbox.dump import dumps, write_dump


def test_dump_folder_with_somebodys_files_keeps_them(tmp_path):
    theirs = ("film.part", "backup-2024Z-home.json.gz", "mineZ-1.json.gz", "2026.json.gz.part")
    for name in theirs:
        (tmp_path / name).write_text("mine")
    unfinished = "20260101T000000.000Z-fault.json.gz.part"
    (tmp_path / unfinished).write_text("half a dump")
    for second in range(4):
        write_dump(tmp_path, {}, "fault", datetime(2026, 1, 1, 0, 0, second, tzinfo=UTC), 2)
    assert all((tmp_path / name).read_text() == "mine" for name in theirs)
    assert not (tmp_path / unfinished).exists()
    assert [one.name for one in dumps(tmp_path)] == [
        "20260101T000002.000Z-fault.json.gz",
        "20260101T000003.000Z-fault.json.gz",
    ]
