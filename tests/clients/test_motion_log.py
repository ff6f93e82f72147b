import pytest
from motion_clients.motion_log import MotionLog, read_motion_log


def test_records_come_back_from_the_file(tmp_path):
    path = tmp_path / "motion.log"
    records = [(123_456_789_012, bytes(range(32))), (123_456_789_013, b"")]
    with MotionLog(path) as log:
        for instant, datagram in records:
            log.write(instant, datagram)
    assert list(log.records) == records
    assert list(read_motion_log(path)) == records


def test_memory_keeps_the_newest():
    log = MotionLog(kept=2)
    for k in range(5):
        log.write(k, b"")
    log.close()
    assert [instant for instant, _ in log.records] == [3, 4]


def test_broken_line_is_named(tmp_path):
    path = tmp_path / "motion.log"
    path.write_text("1 00\nnonsense\n", encoding="ascii")
    with pytest.raises(ValueError, match="line 2"):
        list(read_motion_log(path))
