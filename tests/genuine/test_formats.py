"""Each source's format, written by hand from known motion, must come out as that motion."""

import json
import zipfile

import numpy as np
import pytest

from . import planar, readers, strapped
from .drive import Drive, RefusedError
from .motion import Motion, drive
from .signals import lowpass

# how a device may sit in the car: rows are its axes in vehicle axes
TILTED = np.array(
    [
        [-0.96126170, 0.19866933, -0.19126070],
        [-0.19486710, -0.98006658, -0.03877334],
        [-0.19515130, 0.0, 0.98077321],
    ]
)


def assert_is_motion(made: Drive, truth: Motion, within: float) -> None:
    """Compare below 1 Hz, where every source measures."""
    n = min(len(made.columns["ax"]), len(truth.t))
    for name, signal in {"ax": truth.forward, "ay": truth.left}.items():
        error = lowpass(made.columns[name][:n] - signal[:n], 1.0)
        assert np.sqrt(np.mean(error**2)) < within, name
    assert np.max(np.abs(made.columns["v"][:n] - truth.speed[:n])) < 0.6
    yaw_error = lowpass(made.columns["r"][:n] - truth.rates[:n, 2], 1.0)
    assert np.sqrt(np.mean(yaw_error**2)) < 0.02


def at(made: Drive, seconds: float) -> dict[str, float]:
    return {name: float(column[round(seconds * 100)]) for name, column in made.columns.items()}


def write_ferrari(folder, motion):
    signals = {
        "t": motion.t + 150.0,
        "axCG": motion.forward,
        "ayCG": motion.left,
        "vx": motion.speed,
        "vy": 0.0 * motion.speed,
        "yawRate": motion.rates[:, 2],
    }
    for name, signal in signals.items():
        np.savetxt(folder / f"{name}.txt", signal, fmt="%16.7e")


def write_seoul(folder, motion, handed=1.0):
    for k in range(len(motion.t)):
        state = {
            "theta": (np.pi / 2.0 - handed * motion.heading[k]) % (2.0 * np.pi),
            "v": motion.speed[k],
            "ax": motion.forward[k],
            "ay": motion.left[k],
            "omega": motion.rates[k, 2],
            "lanes": [],
        }
        (folder / f"{k + 1:06d}.json").write_text(json.dumps(state), encoding="utf-8")


def write_dresden(file, motion, late_s):
    force, rates = motion.force @ TILTED.T, np.degrees(motion.rates @ TILTED.T)
    late = np.interp(motion.t - late_s, motion.t, motion.speed) * 3.6
    course = np.degrees(np.pi / 2.0 - np.interp(motion.t - late_s, motion.t, motion.heading)) % 360
    names = "date,time,millis,ax,ay,az,rollrate,pitchrate,yawrate,speed,course"
    with file.open("w", encoding="ascii") as handle:
        handle.write(names + "\n")
        for k, t in enumerate(motion.t):
            held = k - k % 5  # fixes ten times a second
            row = [1.4e12 + 1e3 * t, *-force[k], *rates[k], late[held], course[held]]
            handle.write("260314,0," + ",".join(f"{value:.4f}" for value in row) + "\n")


def write_comma(folder, motion, handed=1.0):
    down = np.array([1.0, -1.0, -1.0])  # forward, left, up to forward, right, down
    start = 46408.5
    east = np.column_stack([0.0 * motion.t, np.cos(motion.heading), np.sin(motion.heading)])
    arrays = {
        "processed_log/IMU/accelerometer/t": motion.t + start,
        "processed_log/IMU/accelerometer/value": motion.force * down * [1.0, handed, 1.0],
        "processed_log/IMU/gyro/t": motion.t + start,
        "processed_log/IMU/gyro/value": motion.rates * down,
        "processed_log/CAN/speed/t": motion.t[::2] + start,
        "processed_log/CAN/speed/value": motion.speed[::2, None],
        "global_pose/frame_times": motion.t[::5] + start,
        # on the equator at longitude 0 east is y and north is z
        "global_pose/frame_velocities": (motion.speed[:, None] * east)[::5],
        "global_pose/frame_positions": np.tile([6378137.0, 0.0, 0.0], (len(motion.t[::5]), 1)),
    }
    for name, array in arrays.items():
        place = folder / name
        place.parent.mkdir(parents=True, exist_ok=True)
        with place.open("wb") as handle:
            np.save(handle, array)


def write_taupo(file, motion):
    start = 1.767e12

    def times(t):
        return np.round(start + 1e3 * t).astype("<u8").tobytes()

    def whole(x):
        return np.round(1e3 * x).astype("<i4").tobytes()

    force, rates = motion.force @ TILTED.T, np.degrees(motion.rates @ TILTED.T)
    bearing = np.degrees(np.pi / 2.0 - motion.heading) % 360.0
    with zipfile.ZipFile(file, "w") as session:
        for name, axes, first in (("2_100_0", force, 9), ("3_101_0", rates, 12)):
            session.writestr(f"channel_{name}_1_1", times(motion.t))
            for k in range(3):
                session.writestr(f"channel_{name}_{first + k}_0", whole(axes[:, k]))
        session.writestr("channel_12_200_4_1_1", times(motion.t[::3]))
        speed = motion.speed[::3].astype("<f8").tobytes()
        session.writestr("channel2_12_200_4_4_3", speed)
        session.writestr("channel_1_300_0_1_1", times(motion.t[::2]))
        session.writestr("channel_1_300_0_6_0", whole(bearing[::2]))


def write_skoda(file, motion, mirrored=1.0):
    latitude = 32.0 + np.degrees(motion.north / 6378137.0)
    longitude = 35.0 + np.degrees(motion.east / 6378137.0 / np.cos(np.radians(32.0))) * mirrored
    force, rates = motion.force / 9.81, np.degrees(motion.rates)
    with file.open("w", encoding="ascii") as handle:
        handle.write("Timestamp,Lat_GNSS,Long_GNSS,Height_GNSS,Acc_X,Acc_Y,Acc_Z,Gyro_X,")
        handle.write("Gyro_Y,Gyro_Z,Magn_X,Magn_Y,Magn_Z\n")
        for k in range(len(motion.t)):
            fix = k - k % 20
            row = [0.1 * k, latitude[fix], longitude[fix], 457.8, *force[k], *rates[k], 0, 0, 0]
            handle.write(",".join(f"{value:.7f}" for value in row) + "\n")


def test_ferrari_known_motion_comes_out(tmp_path):
    write_ferrari(tmp_path, drive(100.0))
    made = planar.convert(readers.ferrari(tmp_path))
    assert_is_motion(made, drive(100.0), 0.02)


def test_planar_sliding_counts_as_acceleration(tmp_path):
    motion = drive(100.0)
    write_ferrari(tmp_path, motion)
    sideways = 1.5 * np.sin(0.8 * motion.t) * np.sin(np.pi * motion.t / motion.t[-1]) ** 2
    sliding = np.gradient(sideways, 0.01)
    np.savetxt(tmp_path / "vy.txt", sideways)
    np.savetxt(tmp_path / "axCG.txt", motion.forward - sideways * motion.rates[:, 2])
    np.savetxt(tmp_path / "ayCG.txt", motion.left + sliding)
    made = planar.convert(readers.ferrari(tmp_path))
    for name in (planar.FORWARD, planar.LEFT):
        assert made.proof.pairs[name] == pytest.approx((1.0, 1.0), abs=0.005), name


def test_planar_offset_at_standstill_is_removed(tmp_path):
    motion = drive(100.0)
    write_ferrari(tmp_path, motion._replace(forward=motion.forward + 0.3, left=motion.left - 0.2))
    made = planar.convert(readers.ferrari(tmp_path))
    assert_is_motion(made, motion, 0.02)


def test_seoul_known_motion_comes_out(tmp_path):
    motion = drive(10.0)
    write_seoul(tmp_path, motion)
    made = planar.convert(readers.seoul(tmp_path, 1, len(motion.t)))
    assert_is_motion(made, drive(100.0), 0.02)
    assert made.proof.pairs[planar.HEADING][1] == pytest.approx(1.0, abs=0.02)


def test_seoul_yaw_rate_against_compass_is_refused(tmp_path):
    motion = drive(10.0)
    write_seoul(tmp_path, motion, handed=-1.0)
    with pytest.raises(RefusedError, match="compass"):
        planar.convert(readers.seoul(tmp_path, 1, len(motion.t)))


def test_dresden_tilted_device_and_late_speed_come_out_as_known_motion(tmp_path):
    write_dresden(tmp_path / "log.csv", drive(50.0), late_s=0.8)
    made = strapped.convert(readers.dresden(tmp_path / "log.csv"))
    assert made.proof.figures["speed delay s"] == pytest.approx(0.8, abs=0.15)
    assert_is_motion(made, drive(100.0), 0.15)


def test_comma_known_motion_comes_out(tmp_path):
    write_comma(tmp_path, drive(100.0))
    made = strapped.convert(readers.comma(tmp_path))
    assert_is_motion(made, drive(100.0), 0.12)
    assert made.proof.figures["gravity m/s^2"] == pytest.approx(9.81, abs=0.02)


def test_comma_left_handed_accelerometers_are_refused(tmp_path):
    write_comma(tmp_path, drive(100.0), handed=-1.0)
    with pytest.raises(RefusedError, match=r"at least 0\.8"):
        strapped.convert(readers.comma(tmp_path))


def test_taupo_known_motion_comes_out(tmp_path):
    write_taupo(tmp_path / "lap.rcz", drive(50.0))
    made = strapped.convert(readers.taupo(tmp_path / "lap.rcz"))
    assert_is_motion(made, drive(100.0), 0.12)


def test_taupo_lap_that_turns_one_way_does_not_tilt_the_road(tmp_path):
    truth = drive(100.0, one_sided=True)
    assert truth.left.mean() > 0.4  # a tilt of 0.05 rad
    write_taupo(tmp_path / "lap.rcz", drive(50.0, one_sided=True))
    made = strapped.convert(readers.taupo(tmp_path / "lap.rcz"))
    assert_is_motion(made, truth, 0.12)
    n = len(made.columns["roll"])
    assert made.columns["roll"].mean() == pytest.approx(truth.roll[:n].mean(), abs=0.02)


def test_skoda_known_motion_comes_out(tmp_path):
    write_skoda(tmp_path / "GNSS.csv", drive(100.0))
    made = strapped.convert(readers.skoda(tmp_path / "GNSS.csv"))
    assert_is_motion(made, drive(100.0), 0.15)


def test_skoda_mirrored_positions_are_refused(tmp_path):
    write_skoda(tmp_path / "GNSS.csv", drive(100.0), mirrored=-1.0)
    with pytest.raises(RefusedError, match="course"):
        strapped.convert(readers.skoda(tmp_path / "GNSS.csv"))


def test_strapped_braking_and_left_turn_have_signs_of_iso_8855(tmp_path):
    write_comma(tmp_path, drive(100.0))
    made = strapped.convert(readers.comma(tmp_path))
    braking, left = at(made, 42.0), at(made, 35.5)
    level = at(made, 30.0)
    assert braking["ax"] < -2.5
    assert braking["pitch"] > level["pitch"]
    assert left["ay"] > 3.0
    assert left["r"] > 0.4
    assert left["roll"] > level["roll"]


def test_strapped_attitude_follows_known_attitude(tmp_path):
    write_comma(tmp_path, drive(100.0))
    made = strapped.convert(readers.comma(tmp_path))
    truth = drive(100.0)
    n = len(made.columns["roll"])
    for name, signal in (("roll", truth.roll), ("pitch", truth.pitch)):
        error = made.columns[name] - signal[:n]
        # the mean is the mounting's: a tilted device on a level road, or the other way about
        assert np.std(error) < 0.008, name


def test_strapped_gravity_of_another_unit_is_refused(tmp_path):
    motion = drive(100.0)
    write_skoda(tmp_path / "GNSS.csv", motion._replace(force=motion.force * 0.95))
    with pytest.raises(RefusedError, match=r"not 9\.81"):
        strapped.convert(readers.skoda(tmp_path / "GNSS.csv"))


def test_strapped_pitch_and_roll_gyros_of_wrong_sign_are_refused(tmp_path):
    motion = drive(100.0)
    write_comma(tmp_path, motion._replace(rates=motion.rates * [-1.0, -1.0, 1.0]))
    with pytest.raises(RefusedError, match="pitch on braking"):
        strapped.convert(readers.comma(tmp_path))


def test_strapped_noise_is_refused(tmp_path):
    motion = drive(100.0)
    noise = np.random.default_rng(1).normal([0.0, 0.0, 9.81], 1.0, motion.force.shape)
    write_comma(tmp_path, motion._replace(force=noise))
    with pytest.raises(RefusedError, match=r"at least 0\.8"):
        strapped.convert(readers.comma(tmp_path))
